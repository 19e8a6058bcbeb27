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
        // Two batches a step, as with `accumulate = 2`.
        for part in [1.0, 3.0] {
            let motion = pose_net.forward(images.clone().mul_scalar(part));
            let loss = motion.axis_angle.sum() * 100.0 + motion.translation.sum();
            let (mut raw, mut of_batch) = (loss.backward(), NamedGradients::default());
            of_batch.add("pose", &pose_net, &mut raw, 0.5);
            for (name, values) in of_batch.by_name {
                // Gradients as tensors, as on a GPU.
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

/// The tensor operations that a GPU runs give the same as the processor's kernel, with clipping, weight decay, two batches a step, and
/// after a restart from a checkpoint. Single parameters may differ: Adam divides a gradient by its size, and a gradient near zero by its
/// rounding error.
#[test]
fn tensor_operations_and_kernel_train_alike() {
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

/// From the same gradients, tensor operations and the kernel make the same step.
#[test]
fn tensor_operations_make_the_kernels_step() {
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
        let factors = AdamFactors::of(&step, &device);
        let learned = (tensor(gradient), moments);
        (parameter, moments) = update_on_device(&step, &factors, parameter, learned);
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
    gradients
        .by_name
        .insert("a".into(), Values::Host(vec![3.0]));
    gradients.by_name.insert("b".into(), Values::Device(tensor));
    assert!((gradients.norm() - 14.0_f64.sqrt()).abs() < 1e-6);
    let mut flat = Vec::new();
    gradients.append_to(&mut flat);
    assert_eq!(flat, [3.0, 1.0, 2.0]);
    gradients.take_from(&[30.0, 10.0, 20.0]);
    flat.clear();
    gradients.append_to(&mut flat);
    assert_eq!(flat, [30.0, 10.0, 20.0]);
}

/// A device that decides makes the steps that the host would make: with the same clipping, and corrected by the number of steps made. A
/// step with a gradient or loss that is not finite changes nothing.
#[test]
fn a_device_decides_as_the_host_does() {
    let device = Device::flex().autodiff();
    let start = || Param::<Tensor<2>>::from_data([[0.5_f32, -1.0, 2.0], [0.1, -0.3, 4.0]], &device);
    let gradient = |values: [f32; 6]| {
        let mut gradients = NamedGradients::on_device();
        let tensor = Tensor::from_data(values, &Device::flex());
        gradients.insert("p".into(), Values::Device(tensor));
        gradients
    };
    let nan = f32::NAN;
    let steps = [
        ([0.3, -4.0, 1e-3, 0.0, 1.0, 2.0], 0.25),
        ([0.3, nan, 1e-3, 0.0, 1.0, 2.0], 0.25),
        ([0.1, 0.2, -0.1, 0.0, 0.05, 0.1], 0.25),
        ([0.1, 0.2, -0.1, 0.0, 0.05, 0.1], nan),
        ([0.0; 6], 0.25),
        ([f32::INFINITY, 0.2, -0.1, 0.0, 0.05, 0.1], 0.25),
        ([1.0, -3.0, 2.0, 1e-5, 0.0, 7.0], 0.25),
    ];
    let learned = |read_every: usize, clip_norm: f64| {
        let (mut parameter, mut adam) = (start(), Adam::default());
        let mut waiting = Vec::new();
        for (number, (values, loss)) in steps.into_iter().enumerate() {
            let gradients = gradient(values);
            let loss = Tensor::from_data([loss], &Device::flex());
            let squares = gradients.squares().1.unwrap();
            let checked = (loss, squares);
            let (is_made, step) = adam.begin_on_device(checked, 1e-2, clip_norm, 0.1);
            parameter = adam.apply(&step, "p", parameter, &gradients);
            waiting.push(is_made.float());
            if (number + 1) % read_every == 0 {
                let made = to_vec(Tensor::cat(std::mem::take(&mut waiting), 0));
                adam.settle(made.iter().sum::<f32>() as u32);
            }
        }
        let made = waiting.into_iter().flat_map(to_vec).sum::<f32>();
        adam.settle(made as u32);
        (to_vec(parameter.val()), adam.state(), adam.steps())
    };
    for clip_norm in [0.7, 0.0] {
        let (mut parameter, mut adam) = (start(), Adam::default());
        for (values, loss) in steps {
            let gradients = gradient(values);
            let (_, step) = adam.begin(&gradients, 1e-2, clip_norm, 0.1);
            let Some(step) = step.filter(|_| loss.is_finite()) else {
                // The loss would have ended a run before it began the step.
                adam.steps -= u32::from(loss.is_nan());
                continue;
            };
            parameter = adam.apply(&step, "p", parameter, &gradients);
        }
        assert_eq!(adam.steps(), 4);
        let each = learned(1, clip_norm);
        assert_eq!(each.2, 4);
        let ours = to_vec(parameter.val());
        for (a, b) in ours.iter().zip(&each.0) {
            assert!((a - b).abs() <= 1e-6, "{ours:?} and {:?}", each.0);
        }
        assert!(apart(&adam.state(), &each.1) < 1e-6);
        // How often the outcomes are read changes nothing.
        for read_every in [3, 7] {
            let some = learned(read_every, clip_norm);
            assert_eq!((&some.0, some.2), (&each.0, each.2), "{read_every}");
            assert_eq!(apart(&some.1, &each.1), 0.0);
        }
    }
}
