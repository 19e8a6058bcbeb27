//! A network's parameters and operations, computed from its configuration, against its weights and its graph.

use burn::tensor::Device;
use deepfusion_infer::Op;
use deepfusion_model::weights::Weights;
use deepfusion_model::{
    DepthNetConfig, HceConfig, InputSize, LiteMonoSize, ModuleCost, PoseNetConfig, ResNetDepth,
    depth_graph, depth_graph_with_uncertainty,
};
use deepfusion_nn::weights::collect;
use deepfusion_nn::{DepthNet, PoseNet};

const SIZE: InputSize = InputSize {
    width: 192,
    height: 96,
};

fn learned(weights: &Weights, prefix: &str) -> u64 {
    let tensors = weights.tensors.iter();
    let counted =
        tensors.filter(|(name, _)| name.starts_with(prefix) && !name.contains(".running_"));
    counted.map(|(_, tensor)| tensor.values.len() as u64).sum()
}

fn check(config: &DepthNetConfig) {
    let weights = collect(&DepthNet::new(config, &Device::flex()).unwrap());
    let graph = depth_graph_with_uncertainty(config, weights.clone()).unwrap();
    let products = graph.multiply_adds(SIZE.width, SIZE.height);
    let values = |index: usize, op: &Op| {
        let shape = graph.shape(deepfusion_infer::ValueId(index + 1));
        let (w, h) = shape.size(SIZE.width, SIZE.height);
        let channels = match op {
            // Concatenation costs nothing: the parts are already in place.
            Op::Concat { .. } => 0,
            Op::UpsampleConcat { input, .. } => graph.shape(*input).channels,
            _ => shape.channels,
        };
        (channels * w * h) as u64
    };
    let costs = config.costs(SIZE);
    for cost in &costs {
        let stem = ["encoder.conv1", "encoder.bn1", "encoder.maxpool"];
        let prefixes: Vec<String> = match cost.name.as_str() {
            "encoder.stem" => stem.map(str::to_owned).to_vec(),
            name => vec![format!("{name}."), format!("{name}|")],
        };
        let parameters: u64 = prefixes.iter().map(|p| learned(&weights, p)).sum();
        assert_eq!(cost.parameters, parameters, "{}", cost.name);
        let (mut multiply_adds, mut given) = (0, 0);
        for (i, node) in graph.nodes().iter().enumerate() {
            let name = format!("{}|", node.name);
            if prefixes.iter().any(|p| name.starts_with(p)) {
                multiply_adds += products[i];
                given += values(i, &node.op);
            }
        }
        assert_eq!(cost.multiply_adds, multiply_adds, "{}", cost.name);
        assert_eq!(cost.values, given, "{}", cost.name);
    }
    let all = |of: fn(&ModuleCost) -> u64| costs.iter().map(of).sum::<u64>();
    assert_eq!(all(|c| c.parameters), learned(&weights, ""));
    assert_eq!(all(|c| c.multiply_adds), products.iter().sum::<u64>());
}

#[test]
fn costs_are_those_of_the_graph_and_the_weights() {
    let mut config = DepthNetConfig::paper();
    config.encoder.base_width = 8;
    check(&config);
    let mut config = DepthNetConfig::new(ResNetDepth::ResNet18);
    config.encoder.base_width = 8;
    check(&config);
    config.hce = Some(HceConfig {
        reduce_first: false,
        global_pool: false,
        ..HceConfig::default()
    });
    check(&config);
}

#[test]
fn lite_monos_costs_are_those_of_its_graph_and_its_weights() {
    let mut config = DepthNetConfig::lite_mono(LiteMonoSize::Tiny);
    check(&config);
    config.uncertainty = true;
    check(&config);
}

/// The graph has 1×3 and 3×1 kernels as 3×3 kernels, of which two thirds are zeros.
#[test]
fn r_msfms_costs_are_those_of_its_graph_and_its_weights() {
    for iterations in [3, 6] {
        let config = DepthNetConfig::r_msfm(iterations);
        let weights = collect(&DepthNet::new(&config, &Device::flex()).unwrap());
        let graph = depth_graph(&config, weights.clone()).unwrap();
        let products = graph.multiply_adds(SIZE.width, SIZE.height);
        let costs = config.costs(SIZE);
        for cost in &costs {
            let of = match cost.name.as_str() {
                "r_msfm.encoder.stem" => continue,
                name => format!("{name}."),
            };
            assert_eq!(cost.parameters, learned(&weights, &of), "{of}");
        }
        let all = |of: fn(&ModuleCost) -> u64| costs.iter().map(of).sum::<u64>();
        assert_eq!(all(|c| c.parameters), learned(&weights, ""));
        let true_products = graph.nodes().iter().zip(&products).map(|(node, count)| {
            let strip = [".across", ".down."].iter().any(|s| node.name.contains(s))
                || node.name.ends_with(".down");
            let named = node.name.starts_with("r_msfm.start") || node.name == "r_msfm.sigmoid";
            match (strip, named) {
                (true, _) => count / 3,
                // The start of the refinement and the sigmoid are not layers.
                (_, true) => 0,
                _ => *count,
            }
        });
        assert_eq!(all(|c| c.multiply_adds), true_products.sum::<u64>());
    }
}

/// The graph has transposed kernels as convolutions, of which three quarters are zeros.
#[test]
fn disp_nets_costs_are_those_of_its_graph_and_its_weights() {
    let mut config = DepthNetConfig::disp_net();
    for uncertainty in [false, true] {
        config.uncertainty = uncertainty;
        let weights = collect(&DepthNet::new(&config, &Device::flex()).unwrap());
        let graph = depth_graph_with_uncertainty(&config, weights.clone()).unwrap();
        let products = graph.multiply_adds(SIZE.width, SIZE.height);
        let costs = config.costs(SIZE);
        for cost in &costs {
            let of = format!("{}.", cost.name);
            assert_eq!(cost.parameters, learned(&weights, &of), "{of}");
        }
        let all = |of: fn(&ModuleCost) -> u64| costs.iter().map(of).sum::<u64>();
        assert_eq!(all(|c| c.parameters), learned(&weights, ""));
        let true_products = graph.nodes().iter().zip(&products).map(|(node, count)| {
            if node.name.ends_with(".enlarge") {
                count / 4
            } else if node.name.ends_with(".disparity") {
                // 10·σ + 0.01 is not a layer.
                0
            } else {
                *count
            }
        });
        assert_eq!(all(|c| c.multiply_adds), true_products.sum::<u64>());
    }
}

#[test]
fn the_pose_networks_parameters_are_its_weights() {
    let mut config = PoseNetConfig::new(ResNetDepth::ResNet50);
    config.encoder.base_width = 8;
    for explainability in [false, true] {
        config.explainability = explainability;
        let weights = collect(&PoseNet::new(&config, &Device::flex()).unwrap());
        assert_eq!(config.cost(SIZE).parameters, learned(&weights, ""));
    }
}
