//! The supported codecs of streams in messages, and where decoding can begin.

use super::nal::units;

/// The codec of a stream whose packets are in messages, one picture in each.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Codec {
    /// H.264 in Annex B: units after start codes.
    H264,
    /// H.265 (HEVC) in Annex B.
    H265,
    /// VP9, one frame per packet.
    Vp9,
    /// AV1, one temporal unit per packet.
    Av1,
}

impl Codec {
    /// The codec by a name used in messages: the codec's own, or that of an encoder in ffmpeg (`libx264`, `hevc_nvenc`). The text
    /// after a semicolon or a space is about pixels. `None` for any other, such as `jpeg`.
    #[must_use]
    pub fn named(format: &str) -> Option<Self> {
        let name = format.split([';', ' ']).next().unwrap_or_default();
        let name = name.to_ascii_lowercase();
        let is = |names: &[&str], family: &str| {
            names.contains(&name.as_str())
                || name
                    .strip_prefix(family)
                    .is_some_and(|rest| rest.starts_with('_'))
        };
        if is(
            &["h264", "avc", "libx264", "libx264rgb", "libopenh264"],
            "h264",
        ) {
            Some(Self::H264)
        } else if is(&["h265", "hevc", "libx265"], "hevc") {
            Some(Self::H265)
        } else if is(&["vp9", "libvpx-vp9"], "vp9") {
            Some(Self::Vp9)
        } else if is(&["av1", "libaom-av1", "libsvtav1", "librav1e"], "av1") {
            Some(Self::Av1)
        } else {
            None
        }
    }

    /// Whether a packet can be decoded without those before it: a key frame, with the parameters that it needs.
    #[must_use]
    pub fn begins(self, packet: &[u8]) -> bool {
        match self {
            Self::H264 => {
                let has = |kind| units(packet).any(|unit| unit[0] & 31 == kind);
                // A sequence parameter set and an instantaneous decoder refresh.
                has(7) && has(5)
            }
            Self::H265 => {
                let kinds = || units(packet).map(|unit| (unit[0] >> 1) & 63);
                // A sequence parameter set and an intra random access point.
                kinds().any(|kind| kind == 33) && kinds().any(|kind| (16..=21).contains(&kind))
            }
            Self::Vp9 => packet.first().is_some_and(|first| is_vp9_key(*first)),
            Self::Av1 => has_sequence_header(packet),
        }
    }

    /// Its four letters in an IVF file.
    pub(super) fn fourcc(self) -> &'static [u8; 4] {
        match self {
            Self::H264 => b"H264",
            Self::H265 => b"H265",
            Self::Vp9 => b"VP90",
            Self::Av1 => b"AV01",
        }
    }

    /// ffmpeg's decoder, if an IVF file does not give it: these two codecs are not usual in IVF.
    pub(super) fn decoder(self) -> Option<&'static str> {
        match self {
            Self::H264 => Some("h264"),
            Self::H265 => Some("hevc"),
            Self::Vp9 | Self::Av1 => None,
        }
    }
}

/// VP9's uncompressed header, 6.2: a two-bit mark, the profile's two bits, `show_existing_frame` and `frame_type`, 0 for a key frame;
/// profile 3 has one more bit before them.
fn is_vp9_key(first: u8) -> bool {
    let profile_3 = first & 0b0011_0000 == 0b0011_0000;
    let bits = if profile_3 { first << 1 } else { first };
    first >> 6 == 2 && bits & 0b0000_1100 == 0
}

/// AV1's low-overhead units, 5.3: a header, and a length with seven bits per byte.
fn has_sequence_header(packet: &[u8]) -> bool {
    let mut rest = packet;
    while let Some((&head, behind)) = rest.split_first() {
        if (head >> 3) & 15 == 1 {
            return true;
        }
        let extension = usize::from(head & 4 != 0);
        let has_length = head & 2 != 0;
        let Some(behind) = behind.get(extension..).filter(|_| has_length) else {
            return false;
        };
        let bytes = behind.iter().take(8).take_while(|b| *b & 128 != 0).count() + 1;
        let parts = behind.iter().take(bytes).enumerate();
        let length = parts.fold(0_usize, |sum, (i, b)| sum | usize::from(b & 127) << (7 * i));
        let Some(next) = bytes.checked_add(length).and_then(|end| behind.get(end..)) else {
            return false;
        };
        rest = next;
    }
    false
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codecs_are_known_by_their_names_and_their_encoders() {
        for (name, codec) in [
            ("h264", Some(Codec::H264)),
            ("H264;yuv420p;bgr8", Some(Codec::H264)),
            ("h264_nvenc", Some(Codec::H264)),
            ("libx264", Some(Codec::H264)),
            ("hevc_vaapi", Some(Codec::H265)),
            ("h265", Some(Codec::H265)),
            ("vp9", Some(Codec::Vp9)),
            ("libsvtav1;yuv420p", Some(Codec::Av1)),
            ("bgr8; jpeg compressed bgr8", None),
            ("jpeg", None),
            ("h2645", None),
            ("", None),
        ] {
            assert_eq!(Codec::named(name), codec, "{name}");
        }
    }

    #[test]
    fn key_frames_are_recognised_by_their_headers() {
        let start = [0, 0, 0, 1];
        let of = |kinds: &[u8]| -> Vec<u8> {
            kinds
                .iter()
                .flat_map(|k| [start.as_slice(), &[*k, 9, 9]].concat())
                .collect()
        };
        assert!(Codec::H264.begins(&of(&[0x67, 0x68, 0x65])));
        assert!(!Codec::H264.begins(&of(&[0x65])), "without its parameters");
        assert!(!Codec::H264.begins(&of(&[0x41])));
        // VPS, SPS, PPS, IDR_W_RADL.
        assert!(Codec::H265.begins(&of(&[32 << 1, 33 << 1, 34 << 1, 19 << 1])));
        assert!(!Codec::H265.begins(&of(&[1 << 1])));
        // The first bytes of streams written by libvpx and SVT-AV1.
        assert!(Codec::Vp9.begins(&[0x82, 0x49, 0x83, 0x42]));
        assert!(!Codec::Vp9.begins(&[0x86, 0x00]));
        assert!(Codec::Av1.begins(&[0x12, 0x00, 0x0a, 0x0a, 0, 0, 0, 3]));
        assert!(!Codec::Av1.begins(&[0x12, 0x00, 0x32, 0x02, 1, 2]));
        for codec in [Codec::H264, Codec::H265, Codec::Vp9, Codec::Av1] {
            for packet in [
                &[][..],
                &[0],
                &[0, 0, 1],
                &[0x12, 0xff, 0xff, 0xff],
                &[255; 40],
            ] {
                assert!(!codec.begins(packet), "{codec:?} {packet:?}");
            }
        }
    }
}
