//! The device of the kernels, and how values are made and compared.

#[cfg(any(feature = "vulkan", feature = "wgpu", feature = "metal"))]
use burn::tensor::DeviceKind;
use burn::tensor::{Device, Tensor, TensorData};
use std::cell::Cell;

/// Two ways of summing the same few hundred products in f32 differ by less.
const TOLERANCE: f32 = 2e-5;

/// The device on which the kernels are checked. In a build for several, `DEEPFUSION_TEST_DEVICE=cuda` selects `cuda`.
pub(super) fn device() -> Device {
    #[cfg(feature = "cuda")]
    if std::env::var("DEEPFUSION_TEST_DEVICE").is_ok_and(|name| name == "cuda") {
        return Device::cuda(0).autodiff();
    }
    #[cfg(feature = "vulkan")]
    return Device::vulkan(DeviceKind::DefaultDevice).autodiff();
    #[cfg(all(feature = "wgpu", not(feature = "vulkan")))]
    return Device::wgpu(DeviceKind::DefaultDevice).autodiff();
    #[cfg(all(feature = "cuda", not(any(feature = "vulkan", feature = "wgpu"))))]
    return Device::cuda(0).autodiff();
    #[cfg(all(feature = "metal", not(any(feature = "vulkan", feature = "wgpu"))))]
    return Device::metal(DeviceKind::DefaultDevice).autodiff();
    #[cfg(not(any(
        feature = "vulkan",
        feature = "wgpu",
        feature = "cuda",
        feature = "metal"
    )))]
    Device::flex().autodiff()
}

/// Values from -1 to 1 (SplitMix64), the same in every run: each test has its own thread, and all threads share Burn's generator.
pub(super) fn random<const D: usize>(shape: [usize; D], device: &Device) -> Tensor<D> {
    thread_local! {
        static STATE: Cell<u64> = const { Cell::new(2026) };
    }
    let next = |_| {
        STATE.set(STATE.get().wrapping_add(0x9e37_79b9_7f4a_7c15));
        let mixed = STATE.get();
        let mixed = (mixed ^ (mixed >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((mixed ^ (mixed >> 31)) >> 40) as f32 / (1 << 23) as f32 - 1.0
    };
    let values: Vec<f32> = (0..shape.iter().product::<usize>()).map(next).collect();
    Tensor::from_data(TensorData::new(values, shape), device)
}

/// A copy on another device. Composed operations run on the CPU, since Burn's own operations on a GPU are not checked here: its gradient of
/// a convolution's weights was wrong above 32,768 pixels (WGSL, lavapipe).
pub(super) fn on<const D: usize>(device: &Device, tensor: &Tensor<D>) -> Tensor<D> {
    Tensor::from_data(tensor.to_data(), device)
}

/// The kernels' device or, for the operations that they are compared with, the CPU.
pub(super) fn device_of(ours: bool) -> Device {
    if ours {
        device()
    } else {
        Device::flex().autodiff()
    }
}

pub(super) fn assert_close<const D: usize>(what: &str, a: Tensor<D>, b: Tensor<D>) {
    let plain = Device::flex();
    let (a, b) = (on(&plain, &a), on(&plain, &b));
    assert_eq!(a.dims(), b.dims(), "{what}");
    let scale = b.clone().abs().max().into_scalar::<f32>().max(1.0);
    let difference = a.sub(b).abs().max().into_scalar::<f32>();
    assert!(
        difference < TOLERANCE * scale,
        "{what}: {difference} of {scale}"
    );
}

/// A weighted sum, so that every output has a gradient of its own.
pub(super) fn weigh(output: Tensor<4>) -> Tensor<1> {
    let shape = output.dims();
    let count: usize = shape.iter().product();
    let weights: Vec<f32> = (0..count).map(|i| (i as f32 * 0.7).sin()).collect();
    let weights = Tensor::<1>::from_data(weights.as_slice(), &output.device());
    output.mul(weights.reshape(shape)).sum()
}

pub(super) fn leaf<const D: usize>(tensor: &Tensor<D>) -> Tensor<D> {
    tensor.clone().require_grad()
}
