//! Reads OXTS: one file with thirty numbers for each packet of the vehicle's GPS / IMU.

use super::timestamps::TimeStamps;
use crate::{Error, MissingPart, OxtsField, OxtsProblem, Result, VehicleTrack};
use std::path::Path;

/// The fields' names, in their order (KITTI's `oxts/dataformat.txt`).
const NAMES: [&str; 30] = [
    "lat", "lon", "alt", "roll", "pitch", "yaw", "vn", "ve", "vf", "vl", "vu", "ax", "ay", "az",
    "af", "al", "au", "wx", "wy", "wz", "wf", "wl", "wu", "posacc", "velacc", "navstat", "numsats",
    "posmode", "velmode", "orimode",
];
const ROLL: usize = 3;
const VF: usize = 8;
const AX: usize = 11;
const WX: usize = 17;

/// The values of a packet that this program uses. Vehicle axes: x forward, y left, z up, at the IMU.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OxtsPacket {
    /// Roll, pitch, yaw (heading, 0 = east, counter-clockwise), in radians.
    pub attitude_rad: [f64; 3],
    /// Speed forward, left and up (`vf`, `vl`, `vu`: parallel to the ground), in m/s.
    pub velocity_mps: [f64; 3],
    /// Acceleration along the vehicle's axes (`ax`, `ay`, `az`), in m/s², gravity included.
    pub acceleration_mps2: [f64; 3],
    /// Angular rate about the vehicle's axes (`wx`, `wy`, `wz`), in rad/s.
    pub rate_radps: [f64; 3],
}

impl OxtsPacket {
    /// Reads one packet's file.
    ///
    /// # Errors
    /// [`Error::Oxts`] with the file and the field if there are not 30 values, or one of them is not a
    /// finite number.
    pub fn read(path: &Path) -> Result<Self> {
        let bytes = std::fs::read(path).map_err(|e| Error::file(path, e))?;
        Self::parse(&String::from_utf8_lossy(&bytes)).map_err(|(field, problem)| Error::Oxts {
            path: path.to_owned(),
            field,
            problem,
        })
    }

    fn parse(text: &str) -> std::result::Result<Self, (OxtsField, OxtsProblem)> {
        let words: Vec<&str> = text.split_whitespace().collect();
        let mut values = [0.0; 30];
        for (i, word) in words.iter().take(30).enumerate() {
            let field = OxtsField::Value {
                name: NAMES[i],
                number: i + 1,
            };
            let value: f64 = word.parse().map_err(|_| {
                let text = (*word).to_owned();
                (field, OxtsProblem::NotANumber { text })
            })?;
            if !value.is_finite() {
                return Err((field, OxtsProblem::NotFinite { value }));
            }
            values[i] = value;
        }
        if words.len() != 30 {
            let found = words.len();
            return Err((OxtsField::Packet, OxtsProblem::Length { found }));
        }
        let three = |i: usize| [values[i], values[i + 1], values[i + 2]];
        Ok(Self {
            attitude_rad: three(ROLL),
            velocity_mps: three(VF),
            acceleration_mps2: three(AX),
            rate_radps: three(WX),
        })
    }
}

/// Reads the packets of an `oxts` folder as a track of forward speed (`vf`), yaw rate (`wz`), roll and pitch over time in
/// seconds from `origin_ns`. Missing packets leave a gap. If all packets have exactly zero roll and pitch but non-zero rates (`wx`, `wy`),
/// as in converted drives whose vehicle only measured rates, the track has the rates instead.
///
/// # Errors
/// [`Error::Missing`] without the folder, its time stamps or any packet; [`Error::TimeStamp`],
/// [`Error::NoTimeStamp`] or [`Error::Oxts`] for bad content.
pub fn read_oxts(folder: &Path, origin_ns: i64) -> Result<VehicleTrack> {
    let sample = |(time_s, packet): &(f64, OxtsPacket)| {
        (*time_s, packet.velocity_mps[0], packet.rate_radps[2])
    };
    let tilt = |(time_s, packet): &(f64, OxtsPacket)| {
        let [roll, pitch, _] = packet.attitude_rad;
        (*time_s, roll, pitch)
    };
    let packets = read_packets(folder, origin_ns)?;
    let track = VehicleTrack::new(&packets.iter().map(sample).collect::<Vec<_>>());
    let tilt_rates = |packet: &OxtsPacket| [packet.rate_radps[0], packet.rate_radps[1]];
    let level = packets.iter().all(|(_, p)| p.attitude_rad[..2] == [0.0; 2]);
    if level && packets.iter().any(|(_, p)| tilt_rates(p) != [0.0; 2]) {
        let rates = packets.iter().map(|(time_s, p)| (*time_s, tilt_rates(p)));
        return Ok(track.with_tilt_rates(&rates.collect::<Vec<_>>(), VehicleTrack::MAX_GAP_S));
    }
    Ok(track.with_tilt(&packets.iter().map(tilt).collect::<Vec<_>>()))
}

/// The packets of an `oxts` folder with their times in seconds from `origin_ns`, ordered by number.
///
/// # Errors
/// Those of [`read_oxts`].
pub(crate) fn read_packets(folder: &Path, origin_ns: i64) -> Result<Vec<(f64, OxtsPacket)>> {
    let data = folder.join("data");
    let missing = || Error::Missing {
        path: data.clone(),
        part: MissingPart::Oxts,
    };
    if !data.is_dir() {
        return Err(missing());
    }
    let packets = super::layout::numbered_files(&data, &["txt"])?;
    if packets.is_empty() {
        return Err(missing());
    }
    let times = TimeStamps::read(&folder.join("timestamps.txt"))?;
    let mut samples = Vec::with_capacity(packets.len());
    for (number, path) in packets {
        let packet = OxtsPacket::read(&path)?;
        if let Some(time_s) = times.seconds(number, origin_ns)? {
            samples.push((time_s, packet));
        }
    }
    Ok(samples)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn packet() -> Vec<String> {
        (0..30).map(|i| format!("{i}.5")).collect()
    }

    #[test]
    fn fields_are_in_the_order_of_dataformat_txt() {
        let read = OxtsPacket::parse(&packet().join(" ")).unwrap();
        assert_eq!(read.attitude_rad, [3.5, 4.5, 5.5]);
        assert_eq!(read.velocity_mps, [8.5, 9.5, 10.5]);
        assert_eq!(read.acceleration_mps2, [11.5, 12.5, 13.5]);
        assert_eq!(read.rate_radps, [17.5, 18.5, 19.5]);
        assert_eq!([NAMES[VF], NAMES[AX], NAMES[WX + 2]], ["vf", "ax", "wz"]);
    }

    #[test]
    fn a_value_that_is_not_a_number_is_named_with_file_and_field() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("0000000007.txt");
        for (bad, problem) in [("NaN", "NaN"), ("inf", "inf"), ("fast", "'fast'")] {
            let mut words = packet();
            words[8] = bad.into();
            std::fs::write(&path, words.join(" ")).unwrap();
            let message = OxtsPacket::read(&path).unwrap_err().to_string();
            assert!(message.contains("0000000007.txt"), "{message}");
            assert!(message.contains("vf (value 9 of 30)"), "{message}");
            assert!(message.contains(problem), "{message}");
        }
        std::fs::write(&path, "1 2 3").unwrap();
        let message = OxtsPacket::read(&path).unwrap_err().to_string();
        assert!(message.contains("3 values, expected 30"), "{message}");
    }

    proptest! {
        #[test]
        fn garbage_never_panics(text in ".{0,300}") {
            let _ = OxtsPacket::parse(&text);
        }

        #[test]
        fn any_thirty_finite_numbers_are_a_packet(values in proptest::collection::vec(-1e6..1e6f64, 30)) {
            let text: Vec<String> = values.iter().map(f64::to_string).collect();
            let read = OxtsPacket::parse(&text.join(" ")).unwrap();
            prop_assert_eq!(read.velocity_mps, [values[8], values[9], values[10]]);
        }
    }
}
