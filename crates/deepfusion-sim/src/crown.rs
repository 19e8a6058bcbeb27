//! Leaves: a lobe of a tree's crown as shells of leaf clumps, with holes between them.
//!
//! A ray crosses up to four nested ellipsoidal shells, first their front and then their back. A shell exists only where there is a clump of
//! leaves; clumps are balls with ragged edges at random places of two grids. So crowns have irregular outlines and let the sky through, and
//! every leaf that is drawn has its own exact depth.

use crate::primitive::{Entry, FACE_LEAVES, V3};
use crate::texture::noise::{hash, unit};

/// Radii of the shells, as shares of the lobe's.
const SHELLS: [f32; 4] = [1.0, 0.83, 0.64, 0.42];

/// How full the shells are, as shares of the lobe's: the outer ones let more light through.
const FILL: [f32; 4] = [0.5, 0.75, 0.95, 1.1];

/// Share of coarse cells (some clumps wide) that are left out of the two outer shells, as dents in the outline.
const DENTS: [f32; 4] = [0.5, 0.25, 0.06, 0.0];

/// One lobe of a crown.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Crown {
    /// Half axes of the outermost shell, metres.
    pub radii: [f32; 3],
    /// Side of the cells that hold one clump each, metres.
    pub cell: f32,
    /// Density of the cells: 0.3 lets most of the light through, 1 hardly any.
    pub fill: f32,
    /// Seed of the clumps.
    pub salt: u32,
}

/// Number of the shell that a face of a crown belongs to, counted from the outside.
#[inline]
pub(crate) fn shell_of(face: u8) -> u8 {
    (face.saturating_sub(FACE_LEAVES)) % SHELLS.len() as u8
}

/// The clump of leaves at a point of a lobe (in its axes): the clump's own hash, or `None` if there is no clump.
#[inline]
pub(crate) fn clump(p: &V3, cell: f32, fill: f32, salt: u32) -> Option<u32> {
    let q = p / cell;
    let fine = {
        let f = q * 4.3;
        unit(
            hash(
                f.x.floor() as i32 + 57 * f.z.floor() as i32,
                f.y.floor() as i32,
                salt,
            ),
            1,
        )
    };
    // A ragged edge: each small cell moves the edge a little.
    let radius = (0.34 + 0.3 * fill) * (0.62 + 0.76 * fine);
    let square = radius * radius;
    let at = |q: V3, salt: u32| {
        let (x, y, z) = (q.x.floor(), q.y.floor(), q.z.floor());
        let code = hash(
            x as i32 + 131 * z as i32,
            y as i32,
            salt.wrapping_add(z as i32 as u32),
        );
        let middle = V3::new(
            0.36 + 0.28 * unit(code, 0),
            0.36 + 0.28 * unit(code, 1),
            0.36 + 0.28 * unit(code, 2),
        );
        let away = q - V3::new(x, y, z) - middle;
        (away.norm_squared() < square && unit(code, 3) < 0.45 + 0.55 * fill).then_some(code)
    };
    at(q, salt).or_else(|| {
        // The second grid is rotated against the first.
        let r = V3::new(
            0.8 * q.x + 0.6 * q.y + 0.31,
            0.8 * q.y - 0.6 * q.x,
            q.z + 0.5,
        );
        at(r, salt ^ 0x5bd1)
    })
}

impl Crown {
    /// Where a ray (in the lobe's axes) first hits a leaf, at t in (0, `limit`).
    #[inline(always)]
    pub(crate) fn enter(&self, o: &V3, d: &V3, limit: f32) -> Option<Entry> {
        let inverse = V3::new(
            1.0 / self.radii[0],
            1.0 / self.radii[1],
            1.0 / self.radii[2],
        );
        let (so, sd) = (o.component_mul(&inverse), d.component_mul(&inverse));
        let square = sd.norm_squared();
        let middle = -so.dot(&sd) / square;
        // Squared distance at which the ray passes the centre, in units of the radii.
        let pass = (so + sd * middle).norm_squared();
        if pass >= 1.0 {
            return None;
        }
        let half = |shell: f32| ((shell * shell - pass) / square).sqrt();
        let seen = |t: f32, shell: usize, face: u8| {
            let inside = t > 0.0 && t < limit;
            let p = o + d * t;
            (inside && self.leafy(&p, shell)).then_some(Entry { t, face })
        };
        let crossed = SHELLS.iter().take_while(|s| **s * **s > pass).count();
        for (number, shell) in SHELLS[..crossed].iter().enumerate() {
            let t = middle - half(*shell);
            if t >= limit {
                return None;
            }
            if let Some(entry) = seen(t, number, FACE_LEAVES + number as u8) {
                return Some(entry);
            }
        }
        for (number, shell) in SHELLS[..crossed].iter().enumerate().rev() {
            let face = FACE_LEAVES + (SHELLS.len() + number) as u8;
            if let Some(entry) = seen(middle + half(*shell), number, face) {
                return Some(entry);
            }
        }
        None
    }

    /// Whether there are leaves at a point of a shell.
    #[inline]
    fn leafy(&self, p: &V3, shell: usize) -> bool {
        let q = p * (0.3 / self.cell);
        let (x, y, z) = (q.x.floor() as i32, q.y.floor() as i32, q.z.floor() as i32);
        let dent = unit(hash(x + 71 * z, y, self.salt ^ 0xD3), 2);
        dent >= DENTS[shell] && clump(p, self.cell, self.fill * FILL[shell], self.salt).is_some()
    }

    /// Normal of the leaves at a point: outward, with a random tilt for each clump.
    #[inline]
    pub(crate) fn normal(&self, p: &V3) -> V3 {
        let [a, b, c] = self.radii;
        let out = V3::new(p.x / (a * a), p.y / (b * b), p.z / (c * c));
        let code = clump(p, self.cell, self.fill, self.salt).unwrap_or(0);
        let lean = V3::new(
            unit(code, 1) - 0.5,
            unit(code, 2) - 0.5,
            unit(code, 0) - 0.35,
        );
        let normal = out / out.norm().max(1e-6) + lean * 1.3;
        normal / normal.norm().max(1e-6)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn crown(fill: f32) -> Crown {
        Crown {
            radii: [2.0, 1.5, 1.2],
            cell: 0.3,
            fill,
            salt: 77,
        }
    }

    /// Rays from all sides through the lobe.
    fn rays() -> impl Iterator<Item = (V3, V3)> {
        (0..4000).map(|i| {
            let angle = i as f32 * 0.37;
            let o = V3::new(9.0 * angle.cos(), 9.0 * angle.sin(), (i % 7) as f32 - 3.0);
            let aim = V3::new(
                ((i * 7) % 11) as f32 * 0.2 - 1.0,
                ((i * 5) % 13) as f32 * 0.15 - 1.0,
                ((i * 3) % 17) as f32 * 0.1 - 0.8,
            );
            (o, aim - o)
        })
    }

    #[test]
    fn a_ray_ends_on_the_first_leaf_inside_the_lobe() {
        let crown = crown(0.7);
        let mut met = 0;
        for (o, d) in rays() {
            let Some(entry) = crown.enter(&o, &d, f32::INFINITY) else {
                continue;
            };
            met += 1;
            let p = o + d * entry.t;
            let depth = V3::new(p.x / 2.0, p.y / 1.5, p.z / 1.2).norm();
            assert!((depth - SHELLS[usize::from(shell_of(entry.face))]).abs() < 1e-3);
            assert!((crown.normal(&p).norm() - 1.0).abs() < 1e-4);
            // A ray that ends earlier hits nothing.
            let shorter = crown.enter(&o, &d, entry.t);
            assert!(shorter.is_none());
        }
        assert!(met > 1500, "{met}");
    }

    #[test]
    fn fuller_crowns_let_less_light_through() {
        let through = |fill| {
            rays()
                .filter(|(o, d)| {
                    let solid = crate::primitive::Shape::Ellipsoid {
                        radii: [2.0, 1.5, 1.2],
                    };
                    crate::primitive::enter(&solid, &[], o, d, 1e9).is_some()
                        && crown(fill).enter(o, d, 1e9).is_none()
                })
                .count()
        };
        let (sparse, dense) = (through(0.2), through(1.0));
        assert!(sparse > 2 * dense && dense > 10, "{sparse} {dense}");
    }
}
