//! Clusters of obstacle pixels: runs along the rows, joined from row to row.

use crate::obstacles::{NONE, Obstacles};
use crate::{PerceptionConfig, Rays};

/// Adjacent pixels of one row that belong together.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Run {
    /// The row.
    pub v: u32,
    /// First column.
    pub from: u32,
    /// The column after the last one.
    pub to: u32,
}

impl Run {
    /// Indices of its pixels in an image of this width, row by row.
    pub(crate) fn pixels(&self, width: usize) -> std::ops::Range<usize> {
        let row = self.v as usize * width;
        row + self.from as usize..row + self.to as usize
    }
}

/// Obstacle pixels that belong together.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Cluster {
    /// The cluster's runs, from the top row down.
    pub runs: Vec<Run>,
    /// Number of pixels.
    pub pixels: usize,
}

impl Cluster {
    /// Left, top, right and bottom pixel (the last two included).
    #[must_use]
    pub(crate) fn bounds(&self) -> [u32; 4] {
        self.runs.iter().fold(
            [u32::MAX, u32::MAX, 0, 0],
            |[left, top, right, bottom], run| {
                [
                    left.min(run.from),
                    top.min(run.v),
                    right.max(run.to - 1),
                    bottom.max(run.v),
                ]
            },
        )
    }

    /// Splits the cluster in two: the pixels for whose point in the camera's frame `beyond` is false, and those for which it is true;
    /// `None` if one part would be empty.
    pub(crate) fn divided(
        &self,
        depth: &[f32],
        rays: &Rays,
        beyond: impl Fn([f32; 3]) -> bool,
    ) -> Option<[Self; 2]> {
        let width = rays.x.len();
        let mut parts = [Self::default(), Self::default()];
        for run in &self.runs {
            let side = |u: u32| {
                let z = depth[run.v as usize * width + u as usize];
                usize::from(beyond(rays.point(u as usize, run.v as usize, z)))
            };
            let mut open = Run {
                to: run.from,
                ..*run
            };
            let mut current = side(run.from);
            for u in run.from + 1..=run.to {
                let next = if u == run.to { 1 - current } else { side(u) };
                if next != current {
                    open.to = u;
                    parts[current].pixels += (open.to - open.from) as usize;
                    parts[current].runs.push(open);
                    open.from = u;
                    current = next;
                }
            }
        }
        parts.iter().all(|part| part.pixels > 0).then_some(parts)
    }
}

/// How far two neighbouring pixels of one surface may differ in depth.
///
/// On an upright surface seen at a grazing angle, such as the side of a car ahead, depth grows by z²·δ/|x| from one column to the next (δ:
/// the angle between them, x: the surface's distance to the side). On a level surface it grows by z²·δ/|y| from row to row. The depth's own
/// error grows with z² in metres, and so with z as a share of the depth.
pub(crate) struct Gaps {
    error: f32,
    step: [f32; 2],
}

impl Gaps {
    /// The gaps for a camera.
    pub(crate) fn of(rays: &Rays, config: &PerceptionConfig) -> Self {
        Self {
            error: config.relative_error,
            step: rays.step,
        }
    }

    /// From one column to the next, for a surface at `x` to the side and `z` ahead, in metres.
    pub(crate) fn across(&self, x: f32, z: f32) -> f32 {
        0.12 + self.limit(x.abs(), z, self.step[0])
    }

    /// Only level surfaces below the camera show more than their edge.
    fn down(&self, y: f32, z: f32) -> f32 {
        0.35 + self.limit(y, z, self.step[1])
    }

    fn limit(&self, side: f32, z: f32, step: f32) -> f32 {
        let grazing = if side > EDGE_ON {
            z * z * step / side
        } else {
            0.0
        };
        (1.3 * grazing).min(1.2) + 2.0 * self.error * z
    }
}

/// A surface that passes the camera at less than this distance, in metres, is seen edge-on.
const EDGE_ON: f32 = 0.4;

/// Joins the obstacle pixels of a depth image into clusters of at least `min_pixels`.
#[must_use]
pub(crate) fn clusters(
    depth: &[f32],
    obstacles: &Obstacles,
    rays: &Rays,
    min_pixels: usize,
    config: &PerceptionConfig,
) -> Vec<Cluster> {
    let width = rays.x.len();
    let gaps = Gaps::of(rays, config);
    let mut runs: Vec<Run> = Vec::new();
    let mut parent: Vec<u32> = Vec::new();
    let mut above = 0..0;
    for v in 0..rays.y.len() {
        let first = runs.len();
        let row = v * width..(v + 1) * width;
        find_runs(
            v,
            &depth[row.clone()],
            &obstacles.height[row],
            rays,
            &gaps,
            &mut runs,
        );
        parent.extend(first as u32..runs.len() as u32);
        join_behind(
            &depth[v * width..(v + 1) * width],
            rays,
            &gaps,
            &runs[first..],
            first,
            &mut parent,
        );
        join_rows(depth, width, rays, &gaps, &runs, above, first, &mut parent);
        above = first..runs.len();
    }
    gather(&runs, &mut parent, min_pixels)
}

fn find_runs(
    v: usize,
    depth: &[f32],
    height: &[f32],
    rays: &Rays,
    gaps: &Gaps,
    runs: &mut Vec<Run>,
) {
    let mut open: Option<u32> = None;
    let mut last = 0.0;
    for (u, (z, h)) in depth.iter().zip(height).enumerate() {
        let joined = open.is_some()
            && *h != NONE
            && (z - last).abs() <= gaps.across(rays.x[u] * z, z.min(last));
        if !joined {
            if let Some(from) = open.take() {
                runs.push(Run {
                    v: v as u32,
                    from,
                    to: u as u32,
                });
            }
            if *h != NONE {
                open = Some(u as u32);
            }
        }
        last = *z;
    }
    if let Some(from) = open {
        runs.push(Run {
            v: v as u32,
            from,
            to: depth.len() as u32,
        });
    }
}

/// Widest object in front of a surface that does not split it, in metres: a lamp post, a sign.
const POST_M: f32 = 0.7;

/// Joins the runs of a row that continue, at the same depth, behind a narrow object that is nearer.
fn join_behind(
    depth: &[f32],
    rays: &Rays,
    gaps: &Gaps,
    runs: &[Run],
    first: usize,
    parent: &mut [u32],
) {
    for (i, run) in runs.iter().enumerate() {
        let end = run.to as usize;
        let z = depth[end - 1];
        for (j, next) in runs.iter().enumerate().skip(i + 1) {
            let start = next.from as usize;
            if (rays.x[start] - rays.x[end - 1]) * z > POST_M {
                break;
            }
            let beyond = depth[start];
            let limit = 0.15 + 2.0 * gaps.across(rays.x[end] * z, z.min(beyond));
            let hidden = || {
                depth[end..start]
                    .iter()
                    .all(|d| *d > 0.0 && *d < z.min(beyond) - 0.4)
            };
            if start > end && (beyond - z).abs() < limit && hidden() {
                let (a, b) = (
                    root(parent, (first + i) as u32),
                    root(parent, (first + j) as u32),
                );
                parent[a.max(b) as usize] = a.min(b);
            }
        }
    }
}

fn join_rows(
    depth: &[f32],
    width: usize,
    rays: &Rays,
    gaps: &Gaps,
    runs: &[Run],
    above: std::ops::Range<usize>,
    first: usize,
    parent: &mut [u32],
) {
    let mut start = above.start;
    for here in first..runs.len() {
        let run = runs[here];
        while start < above.end && runs[start].to <= run.from {
            start += 1;
        }
        for other in start..above.end {
            if runs[other].from >= run.to {
                break;
            }
            let (from, to) = (run.from.max(runs[other].from), run.to.min(runs[other].to));
            let v = run.v as usize;
            let touching = (from as usize..to as usize).any(|u| {
                let (z, z_above) = (depth[v * width + u], depth[(v - 1) * width + u]);
                let near = z.min(z_above);
                (z - z_above).abs() <= gaps.down(rays.y[v] * near, near)
            });
            if touching {
                let (a, b) = (root(parent, here as u32), root(parent, other as u32));
                // The smaller index stays the root, so that clusters are in the order of their top rows.
                parent[a.max(b) as usize] = a.min(b);
            }
        }
    }
}

fn root(parent: &mut [u32], mut index: u32) -> u32 {
    while parent[index as usize] != index {
        let next = parent[index as usize];
        parent[index as usize] = parent[next as usize];
        index = next;
    }
    index
}

fn gather(runs: &[Run], parent: &mut [u32], min_pixels: usize) -> Vec<Cluster> {
    let mut pixels = vec![0usize; runs.len()];
    for (index, run) in runs.iter().enumerate() {
        let root = root(parent, index as u32) as usize;
        pixels[root] += (run.to - run.from) as usize;
    }
    let mut place = vec![usize::MAX; runs.len()];
    let mut clusters: Vec<Cluster> = Vec::new();
    for (index, run) in runs.iter().enumerate() {
        let root = root(parent, index as u32) as usize;
        if pixels[root] < min_pixels {
            continue;
        }
        if place[root] == usize::MAX {
            place[root] = clusters.len();
            clusters.push(Cluster {
                runs: Vec::new(),
                pixels: pixels[root],
            });
        }
        clusters[place[root]].runs.push(*run);
    }
    clusters
}
