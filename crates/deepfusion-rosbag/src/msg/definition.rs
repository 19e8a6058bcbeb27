//! Texts of definitions: a type's fields, then those of every type it uses, each after a line of 80 `=`. Without comments,
//! which the MD5 does not cover.

/// The part of a definition that another type needs.
macro_rules! part {
    ($name:literal, $($line:literal)*) => {
        concat!(
            "================================================================================\nMSG: ",
            $name, "\n", $($line, "\n",)*
        )
    };
}

macro_rules! header {
    () => { part!("std_msgs/Header", "uint32 seq" "time stamp" "string frame_id") };
}

macro_rules! vector3 {
    () => { part!("geometry_msgs/Vector3", "float64 x" "float64 y" "float64 z") };
}

macro_rules! quaternion {
    () => { part!("geometry_msgs/Quaternion", "float64 x" "float64 y" "float64 z" "float64 w") };
}

macro_rules! twist {
    () => { part!("geometry_msgs/Twist", "geometry_msgs/Vector3 linear" "geometry_msgs/Vector3 angular") };
}

macro_rules! transform {
    () => { part!("geometry_msgs/Transform", "geometry_msgs/Vector3 translation" "geometry_msgs/Quaternion rotation") };
}

macro_rules! transforms {
    () => {
        part!(
            "geometry_msgs/TransformStamped",
            "std_msgs/Header header" "string child_frame_id" "geometry_msgs/Transform transform"
        )
    };
}

/// A definition: the type's own lines, then the parts.
macro_rules! definition {
    ($($line:literal)*; $($part:ident!($($inside:tt)*)),*) => {
        concat!($($line, "\n",)* $($part!($($inside)*)),*)
    };
}

pub(crate) use {definition, header, part, quaternion, transform, transforms, twist, vector3};
