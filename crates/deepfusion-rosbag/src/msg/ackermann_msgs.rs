use super::definition::{definition, header, part};
use super::std_msgs::Header;
use super::wire::message;

message! {
    /// Speed and steering of a vehicle with steered front wheels.
    #[derive(Copy, Default)]
    AckermannDrive;
    /// Angle of the virtual front wheel, rad, positive to the left.
    steering_angle: f32,
    /// Rate of the steering angle, rad/s; 0 is "as fast as possible" in commands.
    steering_angle_velocity: f32,
    /// Forward speed, m/s.
    speed: f32,
    /// Acceleration, m/s².
    acceleration: f32,
    /// Jerk, m/s³.
    jerk: f32,
}

message! {
    /// Speed and steering with time and frame: from the vehicle, or to it.
    #[derive(Default)]
    AckermannDriveStamped = "ackermann_msgs/AckermannDriveStamped" "1fd5d7f58889cefd44d29f6653240d0c" definition!(
        "std_msgs/Header header"
        "ackermann_msgs/AckermannDrive drive";
        header!(),
        part!(
            "ackermann_msgs/AckermannDrive",
            "float32 steering_angle"
            "float32 steering_angle_velocity"
            "float32 speed"
            "float32 acceleration"
            "float32 jerk"
        )
    );
    /// Time and frame.
    header: Header,
    /// Speed and steering.
    drive: AckermannDrive,
}
