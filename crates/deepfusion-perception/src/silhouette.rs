//! A cluster seen from above, and which of its ends are real ends of the object.

use crate::clusters::Cluster;
use crate::columns::Columns;
use crate::obstacles::Obstacles;
use crate::outermost::ends;
use crate::{Ground, PerceptionConfig, Rays};

/// A cluster projected onto the ground.
#[derive(Debug, Clone, Default)]
pub(crate) struct Silhouette {
    /// The near end of each column: (right, forward) in metres, from left to right.
    pub contour: Vec<[f32; 2]>,
    /// Height of each of those columns' highest point, metres.
    pub tops: Vec<f32>,
    /// Height of each of those columns' lowest point, metres; 0 if the image ends below it.
    pub feet: Vec<f32>,
    /// Whether each column continues upwards beyond the highest target, to a ceiling or out of the image.
    pub rises: Vec<bool>,
    /// These columns' indices in the image.
    pub columns: Vec<u32>,
    /// A sample of all points, (right, forward, height) in metres.
    pub points: Vec<[f32; 3]>,
    /// Height of its top, metres.
    pub top: f32,
    /// Whether it continues above that, beyond the highest target or the image's border.
    pub tall: bool,
    /// Height of its lowest point, metres.
    pub bottom: f32,
    /// For its left and its right end, how far in front of it an occluder is, in metres of depth; infinite if the image ends there, 0 if
    /// nothing hides it.
    pub hidden: [f32; 2],
}

/// A column whose lowest point is higher than this, in metres, does not show its near end: something hides it.
pub(crate) const FOOT_M: f32 = 0.6;
/// Approximate number of points kept from a cluster.
const POINTS: usize = 400;
/// One in this many of a column's sorted depths is in front of the contour, so that single pixels do not decide.
const NEAR_SHARE: usize = 8;

impl Silhouette {
    /// The silhouette of a cluster in a depth image.
    #[must_use]
    pub(crate) fn of(
        cluster: &Cluster,
        depth: &[f32],
        obstacles: &Obstacles,
        rays: &Rays,
        ground: &Ground,
        config: &PerceptionConfig,
    ) -> Self {
        let width = rays.x.len();
        let mut silhouette = Self {
            points: sampled(cluster, depth, rays, ground),
            ..Self::default()
        };
        [silhouette.bottom, silhouette.top] = reach(cluster, obstacles, width);
        let mut above = Continuation::default();
        Columns::of(cluster, depth, width).for_each(|u, pixels| {
            let top = obstacles.height[pixels[0].1 as usize * width + u];
            let rises = above.follow(u, pixels[0], depth, rays, ground, config);
            let lowest = pixels[pixels.len() - 1].1 as usize;
            // It continues below the image's last row.
            let foot = if lowest + 1 == rays.y.len() {
                0.0
            } else {
                obstacles.height[lowest * width + u]
            };
            let nearest = pixels.len() / NEAR_SHARE;
            let (_, (z, v), _) = pixels.select_nth_unstable_by(nearest, |a, b| a.0.total_cmp(&b.0));
            let p = ground.locate(rays.point(u, *v as usize, *z));
            silhouette.contour.push([p[0], p[1]]);
            silhouette.tops.push(top);
            silhouette.feet.push(foot);
            silhouette.rises.push(rises);
            silhouette.columns.push(u as u32);
        });
        silhouette.tall = above.is_tall();
        silhouette.top = silhouette.top.max(above.top());
        silhouette.hidden = hidden_ends(cluster, depth, width);
        silhouette
    }
}

/// About [`POINTS`] of a cluster's pixels as points: (right, forward, height) in metres.
fn sampled(cluster: &Cluster, depth: &[f32], rays: &Rays, ground: &Ground) -> Vec<[f32; 3]> {
    let width = rays.x.len();
    let stride = Stride::new((cluster.pixels / POINTS).max(1) as u32);
    let pixels = cluster.runs.iter().flat_map(|run| {
        let v = run.v as usize;
        (run.from as usize..run.to as usize).map(move |u| (u, v))
    });
    let mut points = Vec::with_capacity(2 * POINTS);
    for (place, (u, v)) in pixels.enumerate() {
        // Scattered, because a constant stride would hit the same columns in every row.
        if stride.divides(scatter(place)) {
            points.push(ground.locate(rays.point(u, v, depth[v * width + u])));
        }
    }
    points
}

/// A deterministic pseudo-random number for an index.
fn scatter(place: usize) -> u32 {
    ((place as u64).wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 40) as u32
}

/// Tests whether numbers are multiples of a constant, without a division (Lemire et al., "Faster remainder by
/// direct computation", 2019).
struct Stride(u64);

impl Stride {
    fn new(stride: u32) -> Self {
        Self((u64::MAX / u64::from(stride)).wrapping_add(1))
    }

    fn divides(&self, number: u32) -> bool {
        u64::from(number).wrapping_mul(self.0) <= self.0.wrapping_sub(1)
    }
}

/// Height of a cluster's lowest and of its highest pixel.
fn reach(cluster: &Cluster, obstacles: &Obstacles, width: usize) -> [f32; 2] {
    let mut heights = Vec::with_capacity(cluster.pixels);
    for run in &cluster.runs {
        let row = &obstacles.height[run.v as usize * width..];
        heights.extend_from_slice(&row[run.from as usize..run.to as usize]);
    }
    // The topmost and lowest pixels may be strays.
    ends(&mut heights, 100).unwrap_or_default()
}

/// Whether a cluster continues above the height up to which pixels are joined.
#[derive(Default)]
struct Continuation {
    columns: usize,
    tall: usize,
    tops: Vec<f32>,
}

impl Continuation {
    /// Follows a column upwards from its topmost pixel (depth and row) as long as the depth stays the same. Returns whether it rises above
    /// the highest target.
    fn follow(
        &mut self,
        u: usize,
        (start, v): (f32, u32),
        depth: &[f32],
        rays: &Rays,
        ground: &Ground,
        config: &PerceptionConfig,
    ) -> bool {
        self.columns += 1;
        let width = rays.x.len();
        let mut row = v as usize;
        let mut height = ground.locate(rays.point(u, row, start))[2];
        // At most three rows are skipped between the last joined pixel and the joining height.
        if height + 3.0 * start * rays.step[1] < config.join_height_m {
            return false;
        }
        let near = 0.5 + 0.03 * start;
        let mut rises = true;
        while height <= config.max_target_height_m {
            let Some(next) = row.checked_sub(1) else {
                self.tall += 1;
                return true;
            };
            let z = depth[next * width + u];
            if z <= 0.0 || (z - start).abs() > near {
                // A ceiling, or a pipe below it, is nearer; above a roof, the background is farther.
                rises = z > 0.0 && z < start;
                break;
            }
            row = next;
            height = ground.locate(rays.point(u, row, z))[2];
        }
        self.tall += usize::from(rises);
        self.tops.push(height);
        rises
    }

    fn is_tall(&self) -> bool {
        3 * self.tall > self.columns
    }

    /// Height reached by a quarter of the columns; 0 if most end below the joining height.
    fn top(&self) -> f32 {
        let mut tops = self.tops.clone();
        tops.sort_unstable_by(f32::total_cmp);
        let place = self.columns / 4;
        if tops.len() > place {
            tops[tops.len() - 1 - place]
        } else {
            0.0
        }
    }
}

/// An end is hidden if most of the outermost runs end at something nearer, or at the border. Pixels removed as flying count as open:
/// looking past them would complete boxes by what predicted depth has blurred, and found a sixth fewer targets.
fn hidden_ends(cluster: &Cluster, depth: &[f32], width: usize) -> [f32; 2] {
    let [left, _, right, _] = cluster.bounds();
    let reach = ((right - left) / 6).max(1);
    let mut steps: [Vec<f32>; 2] = [Vec::new(), Vec::new()];
    for run in &cluster.runs {
        let row = run.v as usize * width;
        let step = |u: Option<usize>, edge: u32| -> f32 {
            let Some(u) = u.filter(|u| *u < width) else {
                return f32::INFINITY;
            };
            let (there, here) = (depth[row + u], depth[row + edge as usize]);
            let step = here - there;
            if there > 0.0 && step > 0.4 + 0.01 * here {
                step
            } else {
                0.0
            }
        };
        if run.from <= left + reach {
            steps[0].push(step((run.from as usize).checked_sub(1), run.from));
        }
        if run.to > right.saturating_sub(reach) {
            steps[1].push(step(Some(run.to as usize), run.to - 1));
        }
    }
    steps.map(|mut steps| {
        let middle = steps.len() / 2;
        if steps.is_empty() {
            return 0.0;
        }
        *steps.select_nth_unstable_by(middle, f32::total_cmp).1
    })
}
