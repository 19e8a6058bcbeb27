//! The solids that make up everything above the ground, and their intersection with rays.

use crate::crown::Crown;
use nalgebra::Vector3;

/// Short name for the renderer's vectors.
pub(crate) type V3 = Vector3<f32>;

/// Faces of a box, as [`Hit::face`] counts them: +x, −x, +y, −y, top, bottom. The other shapes use
/// [`FACE_TOP`] for their flat top and [`FACE_ROUND`] for the rest.
pub(crate) const FACE_TOP: u8 = 4;
/// A curved surface.
pub(crate) const FACE_ROUND: u8 = 6;
/// The shells of a crown have this number and those after it; no hull has that many faces.
pub(crate) const FACE_LEAVES: u8 = 100;

/// No solid is thicker than this, metres.
const THICKEST: f32 = 1000.0;

/// A convex solid bounded by planes n·p ≤ d in its own axes.
#[derive(Debug, Clone)]
pub(crate) struct Hull {
    /// Outward unit normals and distances.
    pub planes: Vec<(V3, f32)>,
    /// Half extents along x and y and the range of z: a box around it.
    pub bounds: (f32, f32, f32, f32),
}

/// A solid in its own axes: x forward or along the street, y left, z up, metres.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Shape {
    /// Half extents along x and y; z from 0 to `height`.
    Box {
        /// Half the extent along x.
        half_x: f32,
        /// Half the extent along y.
        half_y: f32,
        /// Extent along z.
        height: f32,
    },
    /// Upright, z from 0 to `height`.
    Cylinder {
        /// Radius.
        radius: f32,
        /// Extent along z.
        height: f32,
    },
    /// A cylinder along y around the origin.
    Wheel {
        /// Radius.
        radius: f32,
        /// Half its width.
        half_width: f32,
    },
    /// Around the origin.
    Ellipsoid {
        /// Half axes.
        radii: [f32; 3],
    },
    /// Index of a [`Hull`] of the scene.
    Hull(u32),
    /// A round-ended rod around the origin: a limb, a branch, a rail.
    Capsule {
        /// From the origin to the middle of the end's ball; the other end is opposite.
        half_axis: [f32; 3],
        /// Radius.
        radius: f32,
    },
    /// A lobe of leaves around the origin, with holes.
    Crown(Crown),
}

/// A placed solid.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Primitive {
    /// Origin of its axes in the world.
    pub position: [f64; 3],
    /// Heading of its x axis in the world: cosine and sine.
    pub heading: (f32, f32),
    /// Its shape.
    pub shape: Shape,
    /// Index into the scene's materials.
    pub material: u32,
    /// Seed of its texture.
    pub seed: u32,
    /// Whether it belongs to a dynamic object.
    pub moving: bool,
}

/// Where a ray enters a solid.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Entry {
    /// Position along the ray, in units of the ray's direction.
    pub t: f32,
    /// The face that the ray enters by.
    pub face: u8,
}

impl Primitive {
    /// A world direction in the solid's axes.
    #[inline]
    pub(crate) fn local_of(&self, d: &V3) -> V3 {
        let (c, s) = self.heading;
        V3::new(c * d.x + s * d.y, c * d.y - s * d.x, d.z)
    }

    /// A direction of the solid's axes in the world.
    #[inline]
    pub(crate) fn world_of(&self, d: &V3) -> V3 {
        let (c, s) = self.heading;
        V3::new(c * d.x - s * d.y, s * d.x + c * d.y, d.z)
    }

    /// A world point in the solid's axes; subtracted in f64, so that it is exact far from the origin.
    pub(crate) fn local_point(&self, p: &Vector3<f64>) -> V3 {
        let d = V3::new(
            (p.x - self.position[0]) as f32,
            (p.y - self.position[1]) as f32,
            (p.z - self.position[2]) as f32,
        );
        self.local_of(&d)
    }

    /// Half extents along x and y and the range of z of a box around it, in its own axes.
    pub(crate) fn bounds(&self, hulls: &[Hull]) -> (f32, f32, f32, f32) {
        match self.shape {
            Shape::Box {
                half_x,
                half_y,
                height,
            } => (half_x, half_y, 0.0, height),
            Shape::Cylinder { radius, height } => (radius, radius, 0.0, height),
            Shape::Wheel { radius, half_width } => (radius, half_width, -radius, radius),
            Shape::Ellipsoid { radii: [x, y, z] } => (x, y, -z, z),
            Shape::Hull(index) => hulls[index as usize].bounds,
            Shape::Capsule {
                half_axis: [x, y, z],
                radius,
            } => (
                x.abs() + radius,
                y.abs() + radius,
                -z.abs() - radius,
                z.abs() + radius,
            ),
            Shape::Crown(Crown {
                radii: [x, y, z], ..
            }) => (x, y, -z, z),
        }
    }
}

/// Where a ray from `o` along `d` (in the solid's axes) enters the shape, if at t in (0, `limit`).
#[inline(always)]
pub(crate) fn enter(shape: &Shape, hulls: &[Hull], o: &V3, d: &V3, limit: f32) -> Option<Entry> {
    match *shape {
        Shape::Box {
            half_x,
            half_y,
            height,
        } => enter_box(half_x, half_y, height, o, d, limit),
        Shape::Cylinder { radius, height } => enter_cylinder(radius, height, o, d, limit),
        Shape::Wheel { radius, half_width } => enter_wheel(radius, half_width, o, d, limit),
        Shape::Ellipsoid { radii } => enter_ellipsoid(radii, o, d, limit),
        Shape::Hull(index) => enter_hull(&hulls[index as usize], o, d, limit),
        Shape::Capsule { half_axis, radius } => enter_capsule(half_axis, radius, o, d, limit),
        Shape::Crown(ref crown) => crown.enter(o, d, limit),
    }
}

#[inline(always)]
fn enter_box(hx: f32, hy: f32, height: f32, o: &V3, d: &V3, limit: f32) -> Option<Entry> {
    // Slabs; a zero component gives infinities of the right sign (a NaN only on the slab's own
    // plane, which min and max ignore).
    let (ix, iy, iz) = (1.0 / d.x, 1.0 / d.y, 1.0 / d.z);
    let (x1, x2) = ((-hx - o.x) * ix, (hx - o.x) * ix);
    let (y1, y2) = ((-hy - o.y) * iy, (hy - o.y) * iy);
    let (z1, z2) = (-o.z * iz, (height - o.z) * iz);
    let (near_x, near_y, near_z) = (x1.min(x2), y1.min(y2), z1.min(z2));
    let near = near_x.max(near_y).max(near_z);
    let far = x1.max(x2).min(y1.max(y2)).min(z1.max(z2));
    if !(near <= far && near > 0.0 && near < limit) {
        return None;
    }
    let face = if near == near_x {
        u8::from(d.x > 0.0)
    } else if near == near_y {
        2 + u8::from(d.y > 0.0)
    } else {
        4 + u8::from(d.z > 0.0)
    };
    Some(Entry { t: near, face })
}

#[inline(always)]
fn enter_cylinder(radius: f32, height: f32, o: &V3, d: &V3, limit: f32) -> Option<Entry> {
    let a = d.x * d.x + d.y * d.y;
    let b = o.x * d.x + o.y * d.y;
    // The distance of the ray from the axis, by the cross product: it does not cancel far away.
    let cross = o.x * d.y - o.y * d.x;
    let root = radius * radius * a - cross * cross;
    if root <= 0.0 {
        return None;
    }
    let t = (-b - root.sqrt()) / a;
    let z = o.z + t * d.z;
    if t > 0.0 && t < limit && z >= 0.0 && z <= height {
        return Some(Entry {
            t,
            face: FACE_ROUND,
        });
    }
    if d.z < 0.0 && o.z > height {
        let t = (height - o.z) / d.z;
        let (x, y) = (o.x + t * d.x, o.y + t * d.y);
        if t > 0.0 && t < limit && x * x + y * y <= radius * radius {
            return Some(Entry { t, face: FACE_TOP });
        }
    }
    None
}

#[inline(always)]
fn enter_wheel(radius: f32, half_width: f32, o: &V3, d: &V3, limit: f32) -> Option<Entry> {
    let side = if d.y > 0.0 { -half_width } else { half_width };
    let t = (side - o.y) / d.y;
    if t > 0.0 && t < limit {
        let (x, z) = (o.x + t * d.x, o.z + t * d.z);
        if x * x + z * z <= radius * radius {
            return Some(Entry {
                t,
                face: 2 + u8::from(d.y > 0.0),
            });
        }
    }
    let a = d.x * d.x + d.z * d.z;
    let b = o.x * d.x + o.z * d.z;
    let cross = o.x * d.z - o.z * d.x;
    let root = radius * radius * a - cross * cross;
    if root <= 0.0 {
        return None;
    }
    let t = (-b - root.sqrt()) / a;
    let y = o.y + t * d.y;
    (t > 0.0 && t < limit && y.abs() <= half_width).then_some(Entry {
        t,
        face: FACE_ROUND,
    })
}

#[inline(always)]
fn enter_ellipsoid(radii: [f32; 3], o: &V3, d: &V3, limit: f32) -> Option<Entry> {
    let inverse = V3::new(1.0 / radii[0], 1.0 / radii[1], 1.0 / radii[2]);
    let (o, d) = (o.component_mul(&inverse), d.component_mul(&inverse));
    let a = d.norm_squared();
    let b = o.dot(&d);
    let root = a - o.cross(&d).norm_squared();
    if root <= 0.0 {
        return None;
    }
    let t = (-b - root.sqrt()) / a;
    (t > 0.0 && t < limit).then_some(Entry {
        t,
        face: FACE_ROUND,
    })
}

#[inline(always)]
fn enter_hull(hull: &Hull, o: &V3, d: &V3, limit: f32) -> Option<Entry> {
    let (mut near, mut far, mut face) = (0.0f32, limit, u8::MAX);
    for (index, (normal, distance)) in hull.planes.iter().enumerate() {
        let rate = normal.dot(d);
        let gap = distance - normal.dot(o);
        if rate < 0.0 {
            let t = gap / rate;
            if t > near {
                (near, face) = (t, index as u8);
            }
        } else if rate > 0.0 {
            far = far.min(gap / rate);
        } else if gap < 0.0 {
            return None;
        }
        if near > far {
            return None;
        }
    }
    (face != u8::MAX && near < limit).then_some(Entry { t: near, face })
}

#[inline(always)]
fn enter_capsule(half_axis: [f32; 3], radius: f32, o: &V3, d: &V3, limit: f32) -> Option<Entry> {
    // The origin moves to the point of the ray nearest to the middle, so that large numbers do not cancel.
    let square = d.norm_squared();
    let shift = -o.dot(d) / square;
    let o = o + d * shift;
    let half = V3::from(half_axis);
    let reach = half.norm() + radius;
    if o.norm_squared() > reach * reach {
        return None;
    }
    let found = |t: f32| {
        let t = t + shift;
        (t > 0.0 && t < limit).then_some(Entry {
            t,
            face: FACE_ROUND,
        })
    };
    // The round side: distance to the axis equals the radius, between the ends.
    let axis = half.normalize();
    let (od, dd) = (o - axis * axis.dot(&o), d - axis * axis.dot(d));
    let (a, b) = (dd.norm_squared(), od.dot(&dd));
    if a > 1e-9 * square {
        let root = b * b - a * (od.norm_squared() - radius * radius);
        if root <= 0.0 {
            return None;
        }
        let t = (-b - root.sqrt()) / a;
        let along = axis.dot(&(o + d * t));
        if along.abs() <= half.norm() {
            return found(t);
        }
    }
    // The balls at the ends: the ray enters the nearer one.
    let ball = |centre: V3| {
        let from = o - centre;
        let b = from.dot(d);
        let root = b * b - square * (from.norm_squared() - radius * radius);
        if root > 0.0 {
            (-b - root.sqrt()) / square
        } else {
            f32::INFINITY
        }
    };
    found(ball(half).min(ball(-half)))
}

/// As [`enter`], for a ray that begins at t = `from`. If it begins within the solid, the solid is cut there, and the cut has the face that
/// the ray would have entered by.
#[inline]
pub(crate) fn enter_beyond(
    shape: &Shape,
    hulls: &[Hull],
    (o, d): (&V3, &V3),
    (from, limit): (f32, f32),
) -> Option<Entry> {
    let begin = o + d * from;
    let (near, back) = if contains(shape, hulls, &begin) {
        // Start again so far behind that the point is surely outside.
        let back = THICKEST / d.norm();
        (begin - d * back, back)
    } else {
        (begin, 0.0)
    };
    let entry = enter(shape, hulls, &near, d, limit - from + back)?;
    Some(Entry {
        t: from + (entry.t - back).max(0.0),
        face: entry.face,
    })
}

/// Whether a point (in the solid's axes) is within a solid; false for a crown, which is mostly air.
#[inline]
fn contains(shape: &Shape, hulls: &[Hull], p: &V3) -> bool {
    match *shape {
        Shape::Box {
            half_x,
            half_y,
            height,
        } => p.x.abs() < half_x && p.y.abs() < half_y && p.z > 0.0 && p.z < height,
        Shape::Cylinder { radius, height } => {
            p.z > 0.0 && p.z < height && p.x * p.x + p.y * p.y < radius * radius
        }
        Shape::Wheel { radius, half_width } => {
            p.y.abs() < half_width && p.x * p.x + p.z * p.z < radius * radius
        }
        Shape::Ellipsoid { radii: [a, b, c] } => {
            V3::new(p.x / a, p.y / b, p.z / c).norm_squared() < 1.0
        }
        Shape::Hull(index) => {
            let planes = &hulls[index as usize].planes;
            planes
                .iter()
                .all(|(normal, distance)| normal.dot(p) < *distance)
        }
        Shape::Capsule { half_axis, radius } => {
            let half = V3::from(half_axis);
            let along = (half.dot(p) / half.norm_squared()).clamp(-1.0, 1.0);
            (p - half * along).norm_squared() < radius * radius
        }
        Shape::Crown(_) => false,
    }
}

/// Outward normal of the surface at a point (in the solid's axes).
#[inline]
pub(crate) fn normal_at(shape: &Shape, hulls: &[Hull], p: &V3, face: u8) -> V3 {
    match (shape, face) {
        (Shape::Hull(index), face) => hulls[*index as usize].planes[usize::from(face)].0,
        (_, 0) => V3::x(),
        (_, 1) => -V3::x(),
        (_, 2) => V3::y(),
        (_, 3) => -V3::y(),
        (_, 4) => V3::z(),
        (_, 5) => -V3::z(),
        (Shape::Cylinder { radius, .. }, _) => V3::new(p.x / radius, p.y / radius, 0.0),
        (Shape::Wheel { radius, .. }, _) => V3::new(p.x / radius, 0.0, p.z / radius),
        (Shape::Ellipsoid { radii: [a, b, c] }, _) => {
            V3::new(p.x / (a * a), p.y / (b * b), p.z / (c * c)).normalize()
        }
        (Shape::Capsule { half_axis, .. }, _) => {
            let half = V3::from(*half_axis);
            let along = (half.dot(p) / half.norm_squared()).clamp(-1.0, 1.0);
            let out = p - half * along;
            out / out.norm().max(1e-6)
        }
        (Shape::Crown(crown), _) => crown.normal(p),
        (Shape::Box { .. }, _) => V3::z(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn hulls() -> Vec<Hull> {
        // A box with a slanted front, as a hull.
        let slant = V3::new(1.0, 0.0, 1.0).normalize();
        vec![Hull {
            planes: vec![
                (V3::x(), 1.0),
                (-V3::x(), 1.0),
                (V3::y(), 0.7),
                (-V3::y(), 0.7),
                (V3::z(), 1.5),
                (-V3::z(), 0.0),
                (slant, 1.2),
            ],
            bounds: (1.0, 0.7, 0.0, 1.5),
        }]
    }

    /// How far outside the shape a point is; negative inside.
    fn outside(shape: &Shape, hulls: &[Hull], p: &V3) -> f32 {
        match *shape {
            Shape::Box {
                half_x,
                half_y,
                height,
            } => (p.x.abs() - half_x)
                .max(p.y.abs() - half_y)
                .max(-p.z)
                .max(p.z - height),
            Shape::Cylinder { radius, height } => {
                (p.x.hypot(p.y) - radius).max(-p.z).max(p.z - height)
            }
            Shape::Wheel { radius, half_width } => {
                (p.x.hypot(p.z) - radius).max(p.y.abs() - half_width)
            }
            Shape::Ellipsoid { radii: [a, b, c] } => {
                V3::new(p.x / a, p.y / b, p.z / c).norm() - 1.0
            }
            Shape::Hull(i) => hulls[i as usize]
                .planes
                .iter()
                .map(|(n, d)| n.dot(p) - d)
                .fold(f32::MIN, f32::max),
            Shape::Capsule { half_axis, radius } => {
                let half = V3::from(half_axis);
                let along = (half.dot(p) / half.norm_squared()).clamp(-1.0, 1.0);
                (p - half * along).norm() - radius
            }
            // The holes of a crown have their own test.
            Shape::Crown(_) => f32::MIN,
        }
    }

    proptest! {
        /// The entry is on the surface, everything before it is outside, and the normal faces the ray; without an entry, the whole ray is
        /// outside. Rays from below are neither cast nor tested: an upright cylinder has no bottom.
        #[test]
        fn a_ray_enters_where_the_solid_begins(
            which in 0usize..6, angle in 0.0..std::f32::consts::TAU, distance in 4.0..30.0f32,
            up in 0.2..4.0f32, aim_x in -1.2..1.2f32, aim_y in -1.2..1.2f32, aim_z in 0.05..1.6f32,
        ) {
            let shape = [
                Shape::Box { half_x: 1.0, half_y: 0.5, height: 1.3 },
                Shape::Cylinder { radius: 0.8, height: 1.4 },
                Shape::Wheel { radius: 0.9, half_width: 0.4 },
                Shape::Ellipsoid { radii: [1.0, 0.6, 1.4] },
                Shape::Hull(0),
                Shape::Capsule { half_axis: [0.5, 0.2, 0.7], radius: 0.3 },
            ][which];
            let hulls = hulls();
            let o = V3::new(distance * angle.cos(), distance * angle.sin(), up.max(aim_z));
            let d = V3::new(aim_x, aim_y, aim_z) - o;
            let entry = enter(&shape, &hulls, &o, &d, f32::INFINITY);
            let end = entry.map_or(2.0, |e| e.t);
            for i in 0..400 {
                let p = o + d * (end * i as f32 / 400.0);
                prop_assert!(outside(&shape, &hulls, &p) > -2e-4);
            }
            if let Some(e) = entry {
                let p = o + d * e.t;
                prop_assert!(outside(&shape, &hulls, &p).abs() < 1e-3);
                prop_assert!(normal_at(&shape, &hulls, &p, e.face).dot(&d) < 1e-3);
                prop_assert!(enter(&shape, &hulls, &o, &d, e.t * 0.999).is_none());
                // A ray that begins before the entry has the same entry. One that begins just inside is cut there, with the same face.
                let beyond = |from: f32| enter_beyond(&shape, &hulls, (&o, &d), (from, 2.0));
                let before = beyond(0.5 * e.t);
                prop_assert!(before.is_some_and(|b| (b.t - e.t).abs() < 1e-3 && b.face == e.face));
                let from = e.t + 2e-3;
                if contains(&shape, &hulls, &(o + d * from)) {
                    let cut = beyond(from);
                    prop_assert!(cut.is_some_and(|c| (c.t - from).abs() < 1e-4 && c.face == e.face));
                }
            }
        }
    }
}
