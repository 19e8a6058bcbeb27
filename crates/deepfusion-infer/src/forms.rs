use crate::Conv;
use crate::conv::{ConvForm, Geometry, Runs};
use crate::direct::Direct;
use crate::element::Bf16;
use crate::head::Head;
use crate::view::Shared;
use crate::winograd::Winograd;

/// The forms of a convolution in f32.
#[derive(Debug)]
pub(crate) enum F32Conv {
    Direct(Direct),
    Winograd(Winograd),
    Head(Head),
}

impl ConvForm<f32> for F32Conv {
    fn new(conv: &Conv, geometry: Geometry, channel_of: &[Option<usize>]) -> Self {
        if geometry.out.result {
            Self::Head(Head::new(conv, geometry, channel_of))
        } else if Winograd::fits(conv, &geometry, channel_of) {
            Self::Winograd(Winograd::new(conv, geometry, channel_of))
        } else {
            Self::Direct(Direct::new(conv, geometry, channel_of))
        }
    }

    /// All forms read exactly their inputs.
    fn overread(_: usize) -> usize {
        0
    }

    fn name(&self) -> &'static str {
        match self {
            Self::Direct(_) => "direct",
            Self::Winograd(_) => "winograd",
            Self::Head(_) => "head",
        }
    }

    fn geometry(&self) -> &Geometry {
        match self {
            Self::Direct(conv) => &conv.geometry,
            Self::Winograd(conv) => &conv.geometry,
            Self::Head(conv) => &conv.geometry,
        }
    }

    /// All are exact: the direct form and the head read their inputs only, Winograd's tiles only pixels of the image and its border.
    fn reads_beyond_inputs(&self) -> Option<(&Geometry, &Runs)> {
        None
    }

    unsafe fn run(&self, arena: Shared<f32>) {
        // SAFETY: guaranteed by the caller.
        unsafe {
            match self {
                Self::Direct(conv) => conv.run(arena),
                Self::Winograd(conv) => conv.run(arena),
                Self::Head(conv) => conv.run(arena),
            }
        }
    }
}

/// The forms of a convolution in bf16.
#[cfg(target_arch = "x86_64")]
#[derive(Debug)]
pub(crate) enum Bf16Conv {
    Amx(crate::bf16::Amx),
    Head(crate::bf16::HeadDot),
    Winograd(crate::bf16::WinogradDot),
    Dot(crate::bf16::Dot),
}

#[cfg(target_arch = "x86_64")]
impl Bf16Conv {
    pub(crate) fn available() -> bool {
        crate::bf16::has_dot()
    }

    /// The form with dot products of pairs.
    pub(crate) fn without_matrix_unit(
        conv: &Conv,
        geometry: Geometry,
        channel_of: &[Option<usize>],
    ) -> Self {
        if geometry.out.result {
            Self::Head(crate::bf16::HeadDot::new(conv, geometry, channel_of))
        } else if crate::bf16::WinogradDot::fits(conv, &geometry, channel_of) {
            Self::Winograd(crate::bf16::WinogradDot::new(conv, geometry, channel_of))
        } else {
            Self::Dot(crate::bf16::Dot::new(conv, geometry, channel_of))
        }
    }
}

#[cfg(target_arch = "x86_64")]
impl ConvForm<Bf16> for Bf16Conv {
    fn new(conv: &Conv, geometry: Geometry, channel_of: &[Option<usize>]) -> Self {
        if crate::bf16::has_amx() {
            Self::Amx(crate::bf16::Amx::new(conv, geometry, channel_of))
        } else {
            Self::without_matrix_unit(conv, geometry, channel_of)
        }
    }

    fn overread(pitch: usize) -> usize {
        crate::bf16::Amx::overread(pitch).max(crate::bf16::Dot::overread(pitch))
    }

    fn name(&self) -> &'static str {
        match self {
            Self::Amx(conv) => conv.name(),
            Self::Head(_) => "head",
            Self::Winograd(_) => "winograd",
            Self::Dot(conv) => conv.name(),
        }
    }

    fn geometry(&self) -> &Geometry {
        match self {
            Self::Amx(conv) => conv.geometry(),
            Self::Head(conv) => conv.geometry(),
            Self::Winograd(conv) => conv.geometry(),
            Self::Dot(conv) => conv.geometry(),
        }
    }

    fn reads_beyond_inputs(&self) -> Option<(&Geometry, &Runs)> {
        match self {
            Self::Amx(conv) => conv.reads_beyond_inputs(),
            // The head reads its inputs only, Winograd's tiles only pixels of the image and its border.
            Self::Head(_) | Self::Winograd(_) => None,
            Self::Dot(conv) => conv.reads_beyond_inputs(),
        }
    }

    unsafe fn run(&self, arena: Shared<Bf16>) {
        // SAFETY: guaranteed by the caller; `new` is only called if `available` is true.
        unsafe {
            match self {
                Self::Amx(conv) => conv.run(arena),
                Self::Head(conv) => conv.run(arena),
                Self::Winograd(conv) => conv.run(arena),
                Self::Dot(conv) => conv.run(arena),
            }
        }
    }
}

/// bf16 and int8 are not implemented for other processors.
#[cfg(not(target_arch = "x86_64"))]
#[derive(Debug)]
pub(crate) enum Unwritten {}

#[cfg(not(target_arch = "x86_64"))]
impl Unwritten {
    pub(crate) fn available() -> bool {
        false
    }
}

#[cfg(not(target_arch = "x86_64"))]
impl ConvForm<Bf16> for Unwritten {
    fn new(_: &Conv, _: Geometry, _: &[Option<usize>]) -> Self {
        unreachable!("the engine checks `available` first")
    }

    fn overread(_: usize) -> usize {
        0
    }

    fn name(&self) -> &'static str {
        match *self {}
    }

    fn geometry(&self) -> &Geometry {
        match *self {}
    }

    fn reads_beyond_inputs(&self) -> Option<(&Geometry, &Runs)> {
        match *self {}
    }

    unsafe fn run(&self, _: Shared<Bf16>) {
        match *self {}
    }
}

#[cfg(not(target_arch = "x86_64"))]
pub(crate) type Bf16Conv = Unwritten;
#[cfg(not(target_arch = "x86_64"))]
pub(crate) type Int8Conv = Unwritten;
#[cfg(target_arch = "x86_64")]
pub(crate) use crate::int8::Int8Conv;
