use super::definition::{definition, header, part, quaternion, twist, vector3};
use super::geometry_msgs::{PoseWithCovariance, TwistWithCovariance};
use super::std_msgs::Header;
use super::wire::message;

message! {
    /// A vehicle's pose and velocity.
    Odometry = "nav_msgs/Odometry" "cd5e73d190d741a2f92e81eda573aca7" definition!(
        "std_msgs/Header header"
        "string child_frame_id"
        "geometry_msgs/PoseWithCovariance pose"
        "geometry_msgs/TwistWithCovariance twist";
        header!(),
        part!("geometry_msgs/PoseWithCovariance", "geometry_msgs/Pose pose" "float64[36] covariance"),
        part!("geometry_msgs/Pose", "geometry_msgs/Point position" "geometry_msgs/Quaternion orientation"),
        part!("geometry_msgs/Point", "float64 x" "float64 y" "float64 z"),
        quaternion!(),
        part!("geometry_msgs/TwistWithCovariance", "geometry_msgs/Twist twist" "float64[36] covariance"),
        twist!(),
        vector3!()
    );
    /// Time, and the frame of the pose.
    header: Header,
    /// The vehicle's frame, in which the velocity is given.
    child_frame_id: String,
    /// The pose, `frame_id_from_child_frame_id`.
    pose: PoseWithCovariance,
    /// Velocity of the child frame, in the child frame.
    twist: TwistWithCovariance,
}
