use super::*;
use crate::Preset;
use burn::tensor::Device;
use deepfusion_nn::InputSize;

/// Parameters before and after some steps, and the optimiser's state.
fn learned(as_tensors: bool, restore_after: usize) -> [Weights; 3] {
    let device = Device::flex().autodiff();
    let mut config = Preset::Tiny.config();
    config.size = InputSize::new(64, 64).unwrap();
    config.pose_net.metres_per_unit = 1.0;
    let model = Model::new(&config, &device).unwrap();
    let mut pose_net = model.pose_net.clone().unwrap();
    let mut adam = Adam::default();
    let start = weights::collect(&pose_net);
    for step in 0..4 {
        if step == restore_after {
            adam = Adam::restore(adam.state(), adam.steps(), &model).unwrap();
        }
        let values: Vec<f32> = (0..6 * 64 * 64)
            .map(|i| ((i * 7 + step) % 11) as f32 / 11.0)
            .collect();
        let images = Tensor::<4>::from_data(TensorData::new(values, [1, 6, 64, 64]), &device);
        let mut gradients = NamedGradients::default();
        // Of two batches, as with `accumulate = 2`.
        for part in [1.0, 3.0] {
            let motion = pose_net.forward(images.clone().mul_scalar(part));
            let loss = motion.axis_angle.sum() * 100.0 + motion.translation.sum();
            let (mut raw, mut of_batch) = (loss.backward(), NamedGradients::default());
            of_batch.add("pose", &pose_net, &mut raw, 0.5);
            for (name, values) in of_batch.0 {
                // As a GPU's would be.
                let tensor = || Tensor::from_data(values.to_vec().as_slice(), &Device::flex());
                let values = if as_tensors {
                    Values::Device(tensor())
                } else {
                    values
                };
                gradients.insert(name, values);
            }
        }
        let (outcome, step) = adam.begin(&gradients, 1e-3, 0.7, 0.01);
        let StepOutcome::Done { gradient_norm } = outcome else {
            panic!("{outcome:?}");
        };
        assert!(gradient_norm > 0.7, "the step is clipped: {gradient_norm}");
        pose_net = adam.apply(&step.unwrap(), "pose", pose_net, &gradients);
    }
    [start, weights::collect(&pose_net), adam.state()]
}

/// The root of the summed squares of the differences.
fn apart(one: &Weights, other: &Weights) -> f64 {
    assert_eq!(one.tensors.len(), other.tensors.len());
    let of_tensor = |(name, tensor): (&String, &WeightTensor)| {
        let others = &other.tensors[name].values;
        let pairs = tensor.values.iter().zip(others);
        let squares = pairs.map(|(a, b)| (f64::from(*a) - f64::from(*b)).powi(2));
        squares.sum::<f64>()
    };
    one.tensors.iter().map(of_tensor).sum::<f64>().sqrt()
}

/// What a GPU computes as tensor operations is what the processor's kernel computes, with clipping, decay, two batches a step, and
/// from a checkpoint on. Single parameters may differ: Adam divides a gradient by its size, and so one that is next to nothing by
/// its own rounding.
#[test]
fn both_ways_are_the_same_optimiser() {
    let [start, ours, _] = learned(false, 99);
    let moved = apart(&start, &ours);
    let [_, theirs, state] = learned(true, 99);
    let off = apart(&ours, &theirs) / moved;
    assert!(moved > 0.1 && off < 0.02, "{moved}, {off}");
    let [_, resumed, resumed_state] = learned(true, 2);
    assert_eq!(
        apart(&theirs, &resumed) + apart(&state, &resumed_state),
        0.0
    );
}

/// Of the same gradients both make the same step.
#[test]
fn a_step_is_the_kernels() {
    let device = Device::flex();
    let start = [1.0_f32, -2.0, 0.5, 1e-3];
    let (mut p, mut m, mut v) = (start.to_vec(), vec![0.0; 4], vec![0.0; 4]);
    let tensor = |values: &[f32]| Tensor::<1>::from_data(values, &device);
    let mut parameter = tensor(&start).reshape([2, 2]);
    let mut moments = [tensor(&m), tensor(&v)];
    for (t, gradient) in [[0.3_f32, -4.0, 1e-5, 0.0], [0.2, 3.0, -1e-5, 7.0]]
        .iter()
        .enumerate()
    {
        let t = t as i32 + 1;
        let step = AdamStep {
            learning_rate: 1e-2,
            beta1: 0.9,
            beta2: 0.999,
            epsilon: 1e-8,
            correction1: 1.0 - 0.9_f32.powi(t),
            correction2: 1.0 - 0.999_f32.powi(t),
            gradient_scale: 0.5,
            weight_decay: 0.1,
        };
        adam(&step, &mut p, gradient, &mut m, &mut v);
        (parameter, moments) = update_on_device(&step, parameter, tensor(gradient), moments);
        let pairs = [
            (&p, to_vec(parameter.clone().inner())),
            (&m, to_vec(moments[0].clone())),
            (&v, to_vec(moments[1].clone())),
        ];
        for (ours, theirs) in pairs {
            for (a, b) in ours.iter().zip(&theirs) {
                assert!(
                    (a - b).abs() <= 2e-6 * a.abs().max(1e-6),
                    "{ours:?} and {theirs:?}"
                );
            }
        }
    }
}

#[test]
fn gradients_pass_through_main_memory_and_back() {
    let device = Device::flex();
    let mut gradients = NamedGradients::default();
    let tensor = Tensor::from_data([1.0_f32, 2.0], &device);
    gradients.0.insert("a".into(), Values::Host(vec![3.0]));
    gradients.0.insert("b".into(), Values::Device(tensor));
    assert!((gradients.norm() - 14.0_f64.sqrt()).abs() < 1e-6);
    let mut flat = Vec::new();
    gradients.append_to(&mut flat);
    assert_eq!(flat, [3.0, 1.0, 2.0]);
    gradients.take_from(&[30.0, 10.0, 20.0]);
    flat.clear();
    gradients.append_to(&mut flat);
    assert_eq!(flat, [30.0, 10.0, 20.0]);
}
