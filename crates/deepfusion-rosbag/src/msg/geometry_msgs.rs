use super::definition::{definition, header, part, twist, vector3};
use super::std_msgs::Header;
use super::wire::message;

message! {
    /// A vector in the message's frame.
    #[derive(Copy, Default)]
    Vector3;
    /// Along x.
    x: f64,
    /// Along y.
    y: f64,
    /// Along z.
    z: f64,
}

message! {
    /// A point in metres, in the message's frame.
    #[derive(Copy, Default)]
    Point;
    /// Along x.
    x: f64,
    /// Along y.
    y: f64,
    /// Along z.
    z: f64,
}

message! {
    /// A rotation as a unit quaternion, w last. All zeros if the publisher has none.
    #[derive(Copy, Default)]
    Quaternion;
    /// x sin(θ/2).
    x: f64,
    /// y sin(θ/2).
    y: f64,
    /// z sin(θ/2).
    z: f64,
    /// cos(θ/2).
    w: f64,
}

message! {
    /// A position and orientation: `frame_from_child`.
    #[derive(Copy, Default)]
    Pose;
    /// The child's origin in the frame, metres.
    position: Point,
    /// The child's axes in the frame.
    orientation: Quaternion,
}

message! {
    /// A pose with its covariance.
    #[derive(Copy)]
    PoseWithCovariance;
    /// The pose.
    pose: Pose,
    /// Covariance, 6×6, row-major: x, y, z (m), rotation about x, y, z (rad).
    covariance: [f64; 36],
}

message! {
    /// Linear and angular velocity.
    #[derive(Copy, Default)]
    Twist;
    /// Linear velocity, m/s.
    linear: Vector3,
    /// Angular velocity, rad/s.
    angular: Vector3,
}

message! {
    /// A velocity with its covariance.
    #[derive(Copy)]
    TwistWithCovariance;
    /// The velocity.
    twist: Twist,
    /// Covariance, 6×6, row-major: x, y, z (m/s), about x, y, z (rad/s).
    covariance: [f64; 36],
}

message! {
    /// A velocity with its time and frame, such as a vehicle's speed from CAN.
    #[derive(Default)]
    TwistStamped = "geometry_msgs/TwistStamped" "98d34b0043a2093cf9d9345ab6eef12e" definition!(
        "std_msgs/Header header"
        "geometry_msgs/Twist twist";
        header!(), twist!(), vector3!()
    );
    /// Time and frame.
    header: Header,
    /// The velocity.
    twist: Twist,
}

message! {
    /// A velocity with its time, frame and covariance, such as a fused one or wheel odometry.
    TwistWithCovarianceStamped = "geometry_msgs/TwistWithCovarianceStamped" "8927a1a12fb2607ceea095b2dc440a96" definition!(
        "std_msgs/Header header"
        "geometry_msgs/TwistWithCovariance twist";
        header!(),
        part!("geometry_msgs/TwistWithCovariance", "geometry_msgs/Twist twist" "float64[36] covariance"),
        twist!(),
        vector3!()
    );
    /// Time and frame.
    header: Header,
    /// The velocity.
    twist: TwistWithCovariance,
}

message! {
    /// The pose of a frame in another: `parent_from_child`, first rotated, then moved.
    #[derive(Copy, Default)]
    Transform;
    /// The child's origin in the parent, metres.
    translation: Vector3,
    /// The child's axes in the parent.
    rotation: Quaternion,
}

message! {
    /// A transform with its time and the names of its frames.
    #[derive(Default)]
    TransformStamped;
    /// Time, and the parent's frame.
    header: Header,
    /// The child's frame.
    child_frame_id: String,
    /// `parent_from_child`.
    transform: Transform,
}
