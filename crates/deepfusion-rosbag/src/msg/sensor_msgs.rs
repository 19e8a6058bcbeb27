use super::definition::{definition, header, part, quaternion, vector3};
use super::geometry_msgs::{Quaternion, Vector3};
use super::std_msgs::Header;
use super::wire::message;
use std::borrow::Cow;

message! {
    /// An uncompressed image. Its pixels are read by [`Image::rows`](Image::rows) and related functions.
    Image<'a> = "sensor_msgs/Image" "060021388200f6f0f447d0fcd9c64743" definition!(
        "std_msgs/Header header"
        "uint32 height"
        "uint32 width"
        "string encoding"
        "uint8 is_bigendian"
        "uint32 step"
        "uint8[] data";
        header!()
    );
    /// Time of the image, and the camera's optical frame (x right, y down, z forward).
    header: Header,
    /// Rows.
    height: u32,
    /// Columns.
    width: u32,
    /// Encoding of a pixel: `mono8`, `rgb8`, `16UC1`, …
    encoding: String,
    /// Whether numbers of several bytes are big-endian (0 or 1).
    is_bigendian: u8,
    /// Bytes from one row to the next.
    step: u32,
    /// The rows, `step` bytes each.
    data: Cow<'a, [u8]>,
}

message! {
    /// An image as a JPEG or PNG file.
    CompressedImage<'a> = "sensor_msgs/CompressedImage" "8f7a12909da2c9d3332d540a0977563f" definition!(
        "std_msgs/Header header"
        "string format"
        "uint8[] data";
        header!()
    );
    /// Time of the image, and the camera's optical frame.
    header: Header,
    /// `jpeg`, `png`, or longer: `bgr8; jpeg compressed bgr8`.
    format: String,
    /// The file.
    data: Cow<'a, [u8]>,
}

message! {
    /// Part of an image.
    #[derive(Copy, Eq, Hash, Default)]
    RegionOfInterest;
    /// Its left column.
    x_offset: u32,
    /// Its top row.
    y_offset: u32,
    /// Its rows; 0 with a width of 0 is the whole image.
    height: u32,
    /// Its columns.
    width: u32,
    /// Whether the rectified image is cropped as well.
    do_rectify: bool,
}

message! {
    /// A camera's calibration.
    CameraInfo = "sensor_msgs/CameraInfo" "c9a58c1b0b154e0e6da7578cb991d214" definition!(
        "std_msgs/Header header"
        "uint32 height"
        "uint32 width"
        "string distortion_model"
        "float64[] D"
        "float64[9] K"
        "float64[9] R"
        "float64[12] P"
        "uint32 binning_x"
        "uint32 binning_y"
        "sensor_msgs/RegionOfInterest roi";
        header!(),
        part!(
            "sensor_msgs/RegionOfInterest",
            "uint32 x_offset"
            "uint32 y_offset"
            "uint32 height"
            "uint32 width"
            "bool do_rectify"
        )
    );
    /// Time of the calibration, and the camera's optical frame.
    header: Header,
    /// Rows of the calibrated image.
    height: u32,
    /// Columns of the calibrated image.
    width: u32,
    /// `plumb_bob`, `rational_polynomial`, `equidistant`.
    distortion_model: String,
    /// The field `D`: the distortion's coefficients.
    d: Vec<f64>,
    /// The field `K`: intrinsics of the raw image, 3×3, row-major, pixels. All 0 if the camera is not calibrated.
    k: [f64; 9],
    /// The field `R`: `rectified_from_cam`, 3×3, row-major.
    r: [f64; 9],
    /// The field `P`: projection of the rectified image, 3×4, row-major, pixels.
    p: [f64; 12],
    /// Columns combined into one; 0 means 1.
    binning_x: u32,
    /// Rows combined into one; 0 means 1.
    binning_y: u32,
    /// The part of the sensor that was read.
    roi: RegionOfInterest,
}

impl CameraInfo {
    /// The calibration of a pinhole camera without distortion: fx, fy, cx, cy in pixels of an image of this width and height.
    #[must_use]
    pub fn pinhole(
        header: Header,
        [fx, fy, cx, cy]: [f64; 4],
        (width, height): (u32, u32),
    ) -> Self {
        Self {
            header,
            height,
            width,
            distortion_model: "plumb_bob".into(),
            d: vec![0.0; 5],
            k: [fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0],
            r: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
            p: [fx, 0.0, cx, 0.0, 0.0, fy, cy, 0.0, 0.0, 0.0, 1.0, 0.0],
            binning_x: 0,
            binning_y: 0,
            roi: RegionOfInterest::default(),
        }
    }
}

message! {
    /// A field of every point of a cloud.
    #[derive(Eq, Hash)]
    PointField;
    /// Name: `x`, `y`, `z`, `intensity`, `velocity`, …
    name: String,
    /// Offset from the point's start, bytes.
    offset: u32,
    /// Code of the number type, 1 to 8: i8, u8, i16, u16, i32, u32, f32, f64.
    datatype: u8,
    /// Number of elements; 0 means 1.
    count: u32,
}

message! {
    /// A point cloud whose layout is described in the message. Its numbers are read by
    /// [`PointCloud2::column`](PointCloud2::column).
    PointCloud2<'a> = "sensor_msgs/PointCloud2" "1158d486dd51d683ce2f1be655c3c181" definition!(
        "std_msgs/Header header"
        "uint32 height"
        "uint32 width"
        "sensor_msgs/PointField[] fields"
        "bool is_bigendian"
        "uint32 point_step"
        "uint32 row_step"
        "uint8[] data"
        "bool is_dense";
        header!(),
        part!(
            "sensor_msgs/PointField",
            "uint8 INT8=1"
            "uint8 UINT8=2"
            "uint8 INT16=3"
            "uint8 UINT16=4"
            "uint8 INT32=5"
            "uint8 UINT32=6"
            "uint8 FLOAT32=7"
            "uint8 FLOAT64=8"
            "string name"
            "uint32 offset"
            "uint8 datatype"
            "uint32 count"
        )
    );
    /// Time of the measurement, and the sensor's frame.
    header: Header,
    /// Rows; 1 for an unordered cloud.
    height: u32,
    /// Points per row.
    width: u32,
    /// The fields of a point.
    fields: Vec<PointField>,
    /// Whether numbers of several bytes are big-endian.
    is_bigendian: bool,
    /// Bytes from one point to the next.
    point_step: u32,
    /// Bytes from one row to the next.
    row_step: u32,
    /// The points.
    data: Cow<'a, [u8]>,
    /// Whether every point is valid (no NaN).
    is_dense: bool,
}

message! {
    /// An inertial measurement.
    Imu = "sensor_msgs/Imu" "6a62c6daae103f4ff57a132d6f95cec2" definition!(
        "std_msgs/Header header"
        "geometry_msgs/Quaternion orientation"
        "float64[9] orientation_covariance"
        "geometry_msgs/Vector3 angular_velocity"
        "float64[9] angular_velocity_covariance"
        "geometry_msgs/Vector3 linear_acceleration"
        "float64[9] linear_acceleration_covariance";
        header!(), quaternion!(), vector3!()
    );
    /// Time of the measurement, and the sensor's frame.
    header: Header,
    /// Orientation `world_from_imu`, if the sensor provides it.
    orientation: Quaternion,
    /// Covariance of the orientation, 3×3, row-major, rad². If its first element is −1, there is no orientation.
    orientation_covariance: [f64; 9],
    /// Angular velocity, rad/s.
    angular_velocity: Vector3,
    /// Its covariance, 3×3, row-major, (rad/s)². If its first element is −1, there is no angular velocity.
    angular_velocity_covariance: [f64; 9],
    /// Acceleration, m/s², gravity included: +9.8 upwards at rest.
    linear_acceleration: Vector3,
    /// Its covariance, 3×3, row-major, (m/s²)². If its first element is −1, there is no acceleration.
    linear_acceleration_covariance: [f64; 9],
}

message! {
    /// The kind of a satellite fix.
    #[derive(Copy, Eq, Hash, Default)]
    NavSatStatus;
    /// −1 no fix, 0 fix, 1 satellite-based, 2 ground-based augmentation.
    status: i8,
    /// Bits: 1 GPS, 2 GLONASS, 4 COMPASS, 8 Galileo.
    service: u16,
}

message! {
    /// A position from satellites.
    NavSatFix = "sensor_msgs/NavSatFix" "2d3a8cd499b9b4a0249fb98fd05cfa48" definition!(
        "uint8 COVARIANCE_TYPE_UNKNOWN=0"
        "uint8 COVARIANCE_TYPE_APPROXIMATED=1"
        "uint8 COVARIANCE_TYPE_DIAGONAL_KNOWN=2"
        "uint8 COVARIANCE_TYPE_KNOWN=3"
        "std_msgs/Header header"
        "sensor_msgs/NavSatStatus status"
        "float64 latitude"
        "float64 longitude"
        "float64 altitude"
        "float64[9] position_covariance"
        "uint8 position_covariance_type";
        header!(),
        part!(
            "sensor_msgs/NavSatStatus",
            "int8 STATUS_NO_FIX=-1"
            "int8 STATUS_FIX=0"
            "int8 STATUS_SBAS_FIX=1"
            "int8 STATUS_GBAS_FIX=2"
            "uint16 SERVICE_GPS=1"
            "uint16 SERVICE_GLONASS=2"
            "uint16 SERVICE_COMPASS=4"
            "uint16 SERVICE_GALILEO=8"
            "int8 status"
            "uint16 service"
        )
    );
    /// Time of the measurement, and the antenna's frame.
    header: Header,
    /// Whether there is a fix.
    status: NavSatStatus,
    /// Latitude in degrees, positive north (WGS 84).
    latitude: f64,
    /// Longitude in degrees, positive east.
    longitude: f64,
    /// Height above the ellipsoid in metres; NaN if it is unknown.
    altitude: f64,
    /// Covariance, 3×3, row-major, m², about east, north, up.
    position_covariance: [f64; 9],
    /// What is known of the covariance: 0 nothing, 1 approximated, 2 only the diagonal, 3 all of it.
    position_covariance_type: u8,
}
