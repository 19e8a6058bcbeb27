//! The streams of a bag, and its unreadable parts.

use super::index::Index;
use super::packet::VideoTopic;
use super::topics::Topics;
use crate::{DataWarning, IncompleteWarning, Result, Stream, TimesWarning, TopicRole};
use deepfusion_rosbag::MessageSource;

pub(super) fn streams(
    bag: &dyn MessageSource,
    topics: &Topics,
    index: &Index,
) -> Result<Vec<Stream>> {
    let all = bag.topics()?;
    let streams = all.iter().map(|topic| {
        let role = topics.roles(&topic.name).next();
        let (kind, times): (_, Vec<i64>) = match role {
            Some(TopicRole::Image) => ("image", index.images.iter().map(|p| p.stamp_ns).collect()),
            Some(TopicRole::Lidar) => (
                "point_cloud",
                index.scans.iter().map(|p| p.stamp_ns).collect(),
            ),
            Some(TopicRole::Dynamic) => (
                "point_cloud",
                index.dynamic.iter().map(|p| p.stamp_ns).collect(),
            ),
            Some(TopicRole::Imu) => ("imu", index.imu.iter().map(|s| s.0).collect()),
            Some(TopicRole::Speed) if !index.fixes.is_empty() => {
                ("speed", index.fixes.times().collect())
            }
            Some(TopicRole::Speed) => ("speed", index.speed_mps.iter().map(|s| s.0).collect()),
            Some(TopicRole::Steering) => {
                ("steering", index.steering_rad.iter().map(|s| s.0).collect())
            }
            Some(TopicRole::Truth) => ("pose", index.truth.iter().map(|s| s.0).collect()),
            Some(TopicRole::CameraInfo) => ("camera_info", Vec::new()),
            Some(TopicRole::Can) => ("can", Vec::new()),
            None if topics.has_frames(&topic.name) => ("frames", Vec::new()),
            None => ("other", Vec::new()),
        };
        let origin = times.first().copied().unwrap_or_default();
        let seconds: Vec<f64> = times.iter().map(|t| (t - origin) as f64 * 1e-9).collect();
        let mut stream = Stream::new(&topic.name, kind, topic.count as usize, &seconds);
        stream.rate_hz = stream.rate_hz.or(topic.rate_hz());
        stream
    });
    Ok(streams.collect())
}

/// Warnings about unreadable parts of a bag.
pub(super) fn damage_of(bag: &dyn MessageSource, index: &Index) -> Vec<DataWarning> {
    let damaged = bag.damage().map(IncompleteWarning::Damaged);
    let unreadable = index
        .lost
        .first()
        .map(|first| IncompleteWarning::Unreadable {
            parts: index.lost.len(),
            first: first.clone(),
        });
    let damage = damaged.into_iter().chain(unreadable);
    damage.map(DataWarning::from).collect()
}

/// Warnings about oddities of a readable bag.
pub(super) fn oddities_of(topics: &Topics, index: &Index) -> Vec<DataWarning> {
    let late = index.video.as_ref().and_then(VideoTopic::warning);
    let mut warnings: Vec<DataWarning> = late.into_iter().map(DataWarning::from).collect();
    warnings.extend(topics.warnings.iter().cloned());
    warnings.extend(index.silent.iter().cloned());
    warnings.extend(index.computed.iter().cloned());
    warnings.extend(index.unstamped.iter().map(|(topic, messages)| {
        DataWarning::from(TimesWarning::Unstamped {
            topic: topic.clone(),
            messages: *messages,
        })
    }));
    warnings
}
