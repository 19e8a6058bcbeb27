//! `tracklet_labels.xml`: the exact boxes, in the format of KITTI's annotations.

use crate::{SceneObject, Simulation};
use nalgebra::Vector3;
use std::collections::BTreeMap;
use std::fmt::Write;

/// Boxes whose middle is farther than this from the velodyne are not listed, metres.
const REACH_M: f64 = 80.0;

/// An object during consecutive frames in which it is within reach.
struct Stretch {
    object: SceneObject,
    first_frame: usize,
    /// Centre of its underside, and its heading about z, in the velodyne's axes.
    poses: Vec<(Vector3<f64>, f64)>,
}

/// The boxes of all frames.
pub(crate) fn to_xml(simulation: &Simulation) -> String {
    let stretches = stretches(simulation);
    let mut xml = format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\" standalone=\"yes\" ?>\n<!DOCTYPE boost_serialization>\n\
         <boost_serialization signature=\"serialization::archive\" version=\"9\">\n\
         <tracklets class_id=\"0\" tracking_level=\"0\" version=\"0\">\n<count>{}</count>\n<item_version>1</item_version>\n",
        stretches.len()
    );
    for stretch in &stretches {
        let [length, width, height] = stretch.object.size;
        // Writing to a String cannot fail, here and below.
        let _ = writeln!(
            xml,
            "<item><objectType>{}</objectType><h>{height}</h><w>{width}</w><l>{length}</l><first_frame>{}</first_frame>\
             <poses><count>{}</count><item_version>2</item_version>",
            stretch.object.class.label(),
            stretch.first_frame,
            stretch.poses.len()
        );
        for (bottom, yaw) in &stretch.poses {
            let _ = writeln!(
                xml,
                "<item><tx>{:.4}</tx><ty>{:.4}</ty><tz>{:.4}</tz><rx>0</rx><ry>0</ry><rz>{yaw:.5}</rz><state>2</state>\
                 <occlusion>0</occlusion><truncation>0</truncation></item>",
                bottom.x, bottom.y, bottom.z
            );
        }
        xml += "</poses><finished>1</finished></item>\n";
    }
    xml + "</tracklets>\n</boost_serialization>\n"
}

fn stretches(simulation: &Simulation) -> Vec<Stretch> {
    let mut open: BTreeMap<u64, Stretch> = BTreeMap::new();
    let mut closed = Vec::new();
    for frame in 0..simulation.frames() {
        let velo_from_world = simulation.world_from_velo(frame).inverse();
        let mut seen: BTreeMap<u64, Stretch> = BTreeMap::new();
        for object in simulation.objects(frame) {
            let velo_from_object = velo_from_world * object.world_from_object;
            if velo_from_object.translation().norm() > REACH_M {
                continue;
            }
            let below = Vector3::new(0.0, 0.0, -0.5 * object.size[2]);
            let along = velo_from_object.rotate(&Vector3::x());
            let pose = (velo_from_object.transform(&below), along.y.atan2(along.x));
            let mut stretch = open.remove(&object.id).unwrap_or(Stretch {
                object,
                first_frame: frame,
                poses: Vec::new(),
            });
            stretch.poses.push(pose);
            seen.insert(object.id, stretch);
        }
        // Objects not seen in this frame are out of reach.
        closed.extend(std::mem::replace(&mut open, seen).into_values());
    }
    closed.extend(open.into_values());
    closed
}
