use super::definition::{definition, header, part, quaternion, transform, transforms, vector3};
use super::geometry_msgs::TransformStamped;
use super::wire::message;

message! {
    /// Transforms between frames, as published on `/tf` and `/tf_static`.
    #[derive(Default)]
    TFMessage = "tf2_msgs/TFMessage" "94810edda583a504dfda3829e70d7eec" definition!(
        "geometry_msgs/TransformStamped[] transforms";
        transforms!(), header!(), transform!(), vector3!(), quaternion!()
    );
    /// One or more of them.
    transforms: Vec<TransformStamped>,
}

message! {
    /// The same under the name that ROS 1 used before tf2; old recordings have it on `/tf`.
    #[derive(Default)]
    OldTFMessage = "tf/tfMessage" "94810edda583a504dfda3829e70d7eec" definition!(
        "geometry_msgs/TransformStamped[] transforms";
        transforms!(), header!(), transform!(), vector3!(), quaternion!()
    );
    /// One or more of them.
    transforms: Vec<TransformStamped>,
}
