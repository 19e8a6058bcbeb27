//! The frames of `/tf_static` and `/tf`, and the transforms between any two of them.

use deepfusion_geometry::Se3;
use deepfusion_rosbag::msg::TransformStamped;
use nalgebra::Vector3;
use std::collections::BTreeMap;

/// Two transforms count as equal up to these differences: metres, and radians (half a degree). Drivers publish calibrations with
/// few digits.
const SAME_M: f64 = 0.01;
const SAME_RAD: f64 = 0.0087;
/// Most paths between two frames that are compared.
const MAX_CHAINS: usize = 16;

/// All transforms of a bag.
#[derive(Debug, Clone, Default)]
pub(super) struct Frames {
    /// Links by parent and child.
    links: BTreeMap<(String, String), Link>,
    /// Number of invalid transforms, without a rotation or with NaN.
    pub(super) broken: usize,
}

/// A frame's transform to its parent, over the whole bag.
#[derive(Debug, Clone, Copy)]
struct Link {
    /// Transform in the first message.
    parent_from_child: Se3,
    /// Largest difference of later transforms from it.
    change: Change,
}

/// Difference between two transforms.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct Change {
    pub(crate) metres: f64,
    pub(crate) radians: f64,
}

impl Change {
    /// The difference between two transforms.
    pub(super) fn between(a: &Se3, b: &Se3) -> Self {
        Self {
            metres: (a.translation() - b.translation()).norm(),
            radians: (a.inverse() * *b).angle(),
        }
    }

    /// Whether it is negligible.
    pub(super) fn is_small(self) -> bool {
        self.metres <= SAME_M && self.radians <= SAME_RAD
    }

    fn or_larger(self, other: Self) -> Self {
        Self {
            metres: self.metres.max(other.metres),
            radians: self.radians.max(other.radians),
        }
    }
}

impl std::fmt::Display for Change {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let degrees = self.radians.to_degrees();
        write!(f, "{:.3} m and {degrees:.2}°", self.metres)
    }
}

/// A chain of frames from one to another.
#[derive(Debug, Clone)]
pub(super) struct Chain {
    /// Names of the frames, from the source to the target.
    pub(super) names: Vec<String>,
    pub(super) target_from_source: Se3,
}

impl std::fmt::Display for Chain {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.names.join(" → "))
    }
}

/// Result of looking up the transform between two frames.
#[derive(Debug, Clone)]
pub(super) enum Lookup {
    /// The transform is constant.
    Fixed(Chain),
    /// Two chains contradict each other.
    Several(Box<[Chain; 2]>),
    /// The transform changes: the link of the chain that does, and by how much.
    Moves([String; 2], Change),
    /// No chain connects the frames.
    Unknown,
}

impl Frames {
    /// Adds a transform.
    pub(super) fn add(&mut self, transform: &TransformStamped) {
        let (t, q) = (
            transform.transform.translation,
            transform.transform.rotation,
        );
        let numbers = [t.x, t.y, t.z, q.w, q.x, q.y, q.z];
        let norm = [q.w, q.x, q.y, q.z].map(|x| x * x).iter().sum::<f64>();
        if !numbers.iter().all(|x| x.is_finite()) || norm < 1e-12 {
            self.broken += 1;
            return;
        }
        let place = Vector3::new(t.x, t.y, t.z);
        let parent_from_child = Se3::from_quaternion([q.w, q.x, q.y, q.z], place);
        let parent = plain(&transform.header.frame_id).to_owned();
        let child = plain(&transform.child_frame_id).to_owned();
        let link = self.links.entry((parent, child)).or_insert(Link {
            parent_from_child,
            change: Change::default(),
        });
        let change = Change::between(&link.parent_from_child, &parent_from_child);
        link.change = link.change.or_larger(change);
    }

    /// Whether there are no frames.
    pub(super) fn is_empty(&self) -> bool {
        self.links.is_empty()
    }

    /// Whether there is a frame with this name.
    pub(super) fn has(&self, name: &str) -> bool {
        let name = plain(name);
        self.links.keys().any(|(p, c)| p == name || c == name)
    }

    /// All names, sorted.
    pub(super) fn names(&self) -> Vec<&str> {
        let ends = self.links.keys().flat_map(|(p, c)| [p.as_str(), c]);
        let mut names: Vec<&str> = ends.collect();
        names.sort_unstable();
        names.dedup();
        names
    }

    /// The transform from the source's frame to the target's.
    pub(super) fn lookup(&self, target: &str, source: &str) -> Lookup {
        let (target, source) = (plain(target), plain(source));
        if !(self.has(target) && self.has(source)) {
            return Lookup::Unknown;
        }
        let mut fixed = self.chains(target, source, true);
        fixed.sort_by_key(|chain| chain.names.len());
        if let Some(first) = fixed.first() {
            let other = fixed.iter().find(|other| {
                !Change::between(&first.target_from_source, &other.target_from_source).is_small()
            });
            return match other {
                Some(other) => Lookup::Several(Box::new([first.clone(), other.clone()])),
                None => Lookup::Fixed(first.clone()),
            };
        }
        let moving = self.chains(target, source, false);
        let links = moving.first().into_iter().flat_map(|chain| {
            chain.names.windows(2).filter_map(|pair| {
                let link = self.link(&pair[0], &pair[1])?;
                (!link.change.is_small()).then_some((pair, link.change))
            })
        });
        let size = |change: &Change| change.metres + change.radians;
        let worst = links.max_by(|a, b| size(&a.1).total_cmp(&size(&b.1)));
        worst.map_or(Lookup::Unknown, |(pair, change)| {
            Lookup::Moves([pair[0].clone(), pair[1].clone()], change)
        })
    }

    /// The link between two frames, in either direction.
    fn link(&self, a: &str, b: &str) -> Option<&Link> {
        let key = |p: &str, c: &str| (p.to_owned(), c.to_owned());
        self.links
            .get(&key(a, b))
            .or_else(|| self.links.get(&key(b, a)))
    }

    /// The chains without repeated frames, over constant links only or over all links.
    fn chains(&self, target: &str, source: &str, only_fixed: bool) -> Vec<Chain> {
        // Depth first. In a tree there is one chain, so every frame is visited once.
        let mut open = vec![Chain {
            names: vec![source.to_owned()],
            target_from_source: Se3::identity(),
        }];
        let (mut found, mut steps) = (Vec::new(), 0);
        while let Some(chain) = open.pop() {
            steps += 1;
            let here = chain.names.last().map_or("", String::as_str);
            if here == target {
                found.push(chain);
                if found.len() == MAX_CHAINS {
                    break;
                }
                continue;
            }
            // Hundreds of frames with many loops have too many chains to list.
            if steps > 100_000 {
                break;
            }
            for ((parent, child), link) in &self.links {
                if only_fixed && !link.change.is_small() {
                    continue;
                }
                let (next, next_from_here) = if child == here {
                    (parent, link.parent_from_child)
                } else if parent == here {
                    (child, link.parent_from_child.inverse())
                } else {
                    continue;
                };
                if !chain.names.contains(next) {
                    let mut names = chain.names.clone();
                    names.push(next.clone());
                    open.push(Chain {
                        names,
                        target_from_source: next_from_here * chain.target_from_source,
                    });
                }
            }
        }
        found
    }
}

/// A frame's name without the leading slash that some had before tf2.
pub(super) fn plain(name: &str) -> &str {
    name.strip_prefix('/').unwrap_or(name)
}

#[cfg(test)]
mod tests {
    use super::*;
    use deepfusion_rosbag::msg::{Header, Quaternion, Transform, Vector3 as Vector3Msg};

    fn link(parent: &str, child: &str, x: f64, yaw: f64) -> TransformStamped {
        let (sin, cos) = (0.5 * yaw).sin_cos();
        TransformStamped {
            header: Header {
                frame_id: parent.into(),
                ..Header::default()
            },
            child_frame_id: child.into(),
            transform: Transform {
                translation: Vector3Msg { x, y: 0.0, z: 0.0 },
                rotation: Quaternion {
                    x: 0.0,
                    y: 0.0,
                    z: sin,
                    w: cos,
                },
            },
        }
    }

    fn frames(links: &[TransformStamped]) -> Frames {
        let mut frames = Frames::default();
        links.iter().for_each(|link| frames.add(link));
        frames
    }

    fn fixed(found: Lookup) -> Chain {
        match found {
            Lookup::Fixed(chain) => chain,
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn chains_go_through_common_parents() {
        let quarter = std::f64::consts::FRAC_PI_2;
        let tree = frames(&[
            link("base", "/mast", 1.0, quarter),
            link("mast", "camera", 2.0, 0.0),
            link("base", "lidar", 5.0, 0.0),
        ]);
        // The camera is 2 m along the mast's x, which points along the base's y.
        let chain = fixed(tree.lookup("base", "camera"));
        assert_eq!(chain.to_string(), "camera → mast → base");
        let place = chain.target_from_source.translation();
        assert!((place - Vector3::new(1.0, 2.0, 0.0)).norm() < 1e-12);
        // The LiDAR in the camera's axes: it is 4 m ahead of the mast at x = 1, and the camera looks to the left.
        let place = fixed(tree.lookup("camera", "lidar"))
            .target_from_source
            .translation();
        assert!(
            (place - Vector3::new(-2.0, -4.0, 0.0)).norm() < 1e-12,
            "{place}"
        );
        assert!(matches!(tree.lookup("base", "radar"), Lookup::Unknown));
        assert!(
            fixed(tree.lookup("base", "base"))
                .target_from_source
                .translation()
                .norm()
                == 0.0
        );
    }

    #[test]
    fn two_parents_are_an_error_unless_they_agree() {
        let with = |x| {
            frames(&[
                link("base", "a", 1.0, 0.0),
                link("base", "b", 2.0, 0.0),
                link("a", "camera", 3.0, 0.0),
                link("b", "camera", x, 0.0),
            ])
        };
        assert!(matches!(
            with(2.0).lookup("base", "camera"),
            Lookup::Fixed(_)
        ));
        let Lookup::Several(both) = with(2.1).lookup("base", "camera") else {
            panic!("4.0 and 4.1 m");
        };
        let found = both.map(|chain| chain.target_from_source.translation().x);
        assert!(found.contains(&4.0) && found.contains(&4.1), "{found:?}");
    }

    #[test]
    fn moving_frames_are_not_a_mount() {
        let tree = frames(&[
            link("odom", "base", 0.0, 0.0),
            link("base", "pan", 1.0, 0.0),
            link("pan", "camera", 0.1, 0.0),
            link("odom", "base", 7.0, 1.0),
            link("base", "pan", 1.0, 0.3),
        ]);
        assert!(matches!(tree.lookup("pan", "camera"), Lookup::Fixed(_)));
        let Lookup::Moves(names, change) = tree.lookup("base", "camera") else {
            panic!("it pans");
        };
        assert_eq!(names, ["pan", "base"]);
        assert!((change.radians - 0.3).abs() < 1e-12 && change.metres < 1e-12);
    }

    #[test]
    fn a_rotation_of_zeros_is_left_out() {
        let mut zeros = link("base", "camera", 1.0, 0.0);
        zeros.transform.rotation = Quaternion::default();
        let tree = frames(&[zeros]);
        assert!(tree.is_empty());
        assert_eq!(tree.broken, 1);
    }
}
