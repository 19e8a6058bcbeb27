use super::*;
use deepfusion_geometry::Intrinsics;
use deepfusion_model::weights::{WeightTensor, read_safetensors};
use deepfusion_model::{InputNormalisation, Preset, TrainConfig, TrainFindings};

fn weights(tensors: &[(&str, &[f32])]) -> Weights {
    let mut weights = Weights::new("test");
    for (name, values) in tensors {
        let (shape, values) = (vec![values.len()], values.to_vec());
        let tensor = WeightTensor { shape, values };
        weights.tensors.insert((*name).into(), tensor);
    }
    weights
}

const STATE: Checkpoint = Checkpoint {
    step: 7,
    best_validation: Some(0.25),
    skipped: 0,
    encoders_only: false,
    focal_ratio: None,
};

/// A run with a checkpoint, in the given folder.
fn run(
    (folder, kind): (&Path, CheckpointKind),
    tensors: &[(&str, &[f32])],
    state: Checkpoint,
    change: impl FnOnce(&mut TrainConfig, &mut TrainFindings),
) -> PathBuf {
    let run = RunFolder::create(folder).unwrap();
    let (mut config, mut findings) = (Preset::Tiny.config(), TrainFindings::default());
    change(&mut config, &mut findings);
    run.write_config(&config, &findings).unwrap();
    let mut all = weights(tensors);
    all.metadata = state.metadata();
    write_safetensors(&run.checkpoint_path(kind), &all).unwrap();
    folder.to_owned()
}

/// The averaged depth network's weights.
fn depth_of(made: &Averaged) -> Weights {
    read_safetensors(&made.checkpoint).unwrap().under("depth.")
}

const LAST: CheckpointKind = CheckpointKind::Last;
const LAYERS: [(&str, &[f32]); 1] = [("depth.a", &[1.0, 2.0])];

#[test]
fn depth_is_averaged_and_the_rest_is_from_the_first_network() {
    let at = tempfile::tempdir().unwrap();
    let at = at.path();
    let tensors: [(&str, &[f32]); 3] = [
        ("depth.a", &[1.0, 2.0]),
        ("pose.a", &[8.0]),
        ("adam.m.depth.a", &[1.0, 1.0]),
    ];
    let first = run((&at.join("first"), LAST), &tensors, STATE, |_, _| {});
    // A folder stands for its best checkpoint.
    let tensors: [(&str, &[f32]); 2] = [("depth.a", &[3.0, 6.0]), ("pose.a", &[0.0])];
    let second = run(
        (&at.join("second"), CheckpointKind::Best),
        &tensors,
        STATE,
        |config, _| config.init = Some(first.join("last.safetensors")),
    );
    let both = [first, second.clone()];
    let made = average(&both, None, &at.join("mean")).unwrap();
    assert_eq!(made.kinship, Kinship::Network);
    assert!(!made.lost_uncertainty);
    let found = read_safetensors(&made.checkpoint).unwrap();
    let expected = weights(&[("depth.a", &[2.0, 4.0]), ("pose.a", &[8.0])]);
    assert_eq!(found.tensors, expected.tensors);
    let (folder, _) = RunFolder::open(&made.checkpoint).unwrap();
    let state = folder.read_state(LAST).unwrap();
    assert_eq!((state.step, state.best_validation), (7, None));
    let averaged = folder.read_findings().unwrap().averaged;
    assert_eq!(averaged, made.networks);
    assert_eq!(averaged[1].path, second.join("best.safetensors"));
    assert_eq!(averaged[1].share, 0.5);

    let shares = [3.0, 1.0];
    let less = average(&both, Some(&shares), &at.join("less")).unwrap();
    assert_eq!(depth_of(&less).tensors["a"].values, [1.5, 3.0]);
    // An existing run stays.
    let again = average(&both, None, &at.join("mean"));
    assert!(matches!(again, Err(Error::Occupied { .. })), "{again:?}");
    // The mean's ancestors are the networks it was made of, however they were given.
    let by_slash = at.join("second/../second/");
    let again = average(&[at.join("mean"), by_slash], None, &at.join("again"));
    assert_eq!(again.unwrap().kinship, Kinship::Network);
}

/// The mean of the variances leaves out how far apart the means are: 1 beside a variance of 2 in the first channel, nothing in the second.
#[test]
fn differing_statistics_are_reported_and_averaged() {
    let at = tempfile::tempdir().unwrap();
    let at = at.path();
    let with = |name: &str, mean: [f32; 2], variance: [f32; 2]| {
        let tensors: [(&str, &[f32]); 5] = [
            ("depth.a", &[1.0]),
            ("depth.bn1.running_mean", &mean),
            ("depth.bn1.running_var", &variance),
            ("depth.bn2.running_mean", &[0.5]),
            ("depth.bn2.running_var", &[4.0]),
        ];
        run((&at.join(name), LAST), &tensors, STATE, |_, _| {})
    };
    let first = with("first", [1.0, 0.0], [2.0, 1.0]);
    let frozen = with("frozen", [1.0, 0.0], [2.0, 1.0]);
    let moved = with("moved", [3.0, 0.0], [2.0, 3.0]);
    let same = average(&[first.clone(), frozen], None, &at.join("same")).unwrap();
    assert_eq!(same.statistics, None);
    let made = average(&[first, moved], None, &at.join("mean")).unwrap();
    let spread = made.statistics.unwrap();
    assert_eq!((spread.layers, spread.of), (1, 2));
    assert!((spread.left_out - 0.5).abs() < 1e-4, "{spread:?}");
    let depth = depth_of(&made);
    assert_eq!(depth.tensors["bn1.running_mean"].values, [2.0, 0.0]);
    assert_eq!(depth.tensors["bn1.running_var"].values, [2.0, 2.0]);
}

#[test]
fn shares_are_positive_and_one_for_each() {
    let at = tempfile::tempdir().unwrap();
    let at = at.path();
    let one = run((&at.join("one"), LAST), &LAYERS, STATE, |_, _| {});
    let both = [one.clone(), one];
    for shares in [&[1.0][..], &[1.0, 0.0], &[1.0, f64::NAN], &[1e308, 1e308]] {
        let refused = average(&both, Some(shares), &at.join("no"));
        assert!(matches!(refused, Err(Error::Shares { networks: 2, .. })));
    }
    assert!(average(&[], None, &at.join("no")).is_err());
}

/// The weights of one seed, of another seed, of another network, and a run of which only the name is left.
#[test]
fn related_networks_are_recognised() {
    let at = tempfile::tempdir().unwrap();
    let at = at.path();
    let from = |name: &str, init: Option<&str>, seed: u64| {
        run((&at.join(name), LAST), &LAYERS, STATE, |config, _| {
            config.init = init.map(|init| at.join(init));
            config.seed = seed;
        })
    };
    let encoders = Checkpoint {
        encoders_only: true,
        ..STATE
    };
    run((&at.join("imagenet"), LAST), &LAYERS, encoders, |_, _| {});
    std::fs::write(at.join("resnet18.pth"), b"PK").unwrap();
    for (name, init, seeds, kinship) in [
        ("seeds", None, [1, 2], Kinship::Unknown),
        ("seed", None, [1, 1], Kinship::FirstWeights),
        ("gone", Some("gone/run"), [1, 2], Kinship::Network),
        ("encoders", Some("imagenet"), [1, 2], Kinship::Unknown),
        ("resnet", Some("resnet18.pth"), [1, 2], Kinship::Unknown),
    ] {
        let both = [0, 1].map(|i| from(&format!("{name}{i}"), init, seeds[i]));
        let made = average(&both, None, &at.join(name)).unwrap();
        assert_eq!(made.kinship, kinship, "{name}");
    }
    let of = |networks: [PathBuf; 2], name: &str| {
        let made = average(&networks, None, &at.join(name)).unwrap();
        made.kinship
    };
    // A mean of them and a network fine-tuned from one of them share that one; networks fine-tuned from each share only the seed.
    let on = from("on", Some("seed1"), 9);
    let of_mean = of([at.join("seed"), on.clone()], "of-mean");
    assert_eq!(of_mean, Kinship::Network);
    let other = from("other-on", Some("seed0"), 8);
    assert_eq!(of([on, other], "of-both"), Kinship::FirstWeights);

    // Weights of other projects, and a network that starts differently, share nothing of a seed with it.
    let of_the_seed = at.join("seed0");
    let imported = Checkpoint { step: 0, ..STATE };
    let imported = run((&at.join("imported"), LAST), &LAYERS, imported, |c, _| {
        c.seed = 1;
    });
    let other = run((&at.join("other"), LAST), &LAYERS, STATE, |c, _| {
        c.seed = 1;
        c.depth_net.initial_depth_m = Some(20.0);
    });
    for (name, stranger) in [("import", imported), ("start", other)] {
        let kinship = of([of_the_seed.clone(), stranger], name);
        assert_eq!(kinship, Kinship::Unknown, "{name}");
    }
}

/// The uncertainty head stays if all have it, and is dropped if one has not: it depends on the other layers' features.
#[test]
fn the_uncertainty_head_is_kept_only_if_all_have_it() {
    let at = tempfile::tempdir().unwrap();
    let at = at.path();
    let sure: [(&str, &[f32]); 2] = [("depth.a", &[1.0, 2.0]), ("depth.uncertainty.bias", &[4.0])];
    let has = |config: &mut TrainConfig, _: &mut TrainFindings| {
        config.depth_net.uncertainty = true;
        // The head learns only from ground truth.
        let set = "sets = [{ name = 'streets', learn = 'depth', simulated = { seed = 1 } }]";
        config.data = toml::from_str(set).unwrap();
    };
    let sure = [0, 1].map(|i| run((&at.join(format!("sure{i}")), LAST), &sure, STATE, has));
    let plain = run((&at.join("plain"), LAST), &LAYERS, STATE, |_, _| {});
    let made = |name: &str, a: &Path, b: &Path| {
        let made = average(&[a.to_owned(), b.to_owned()], None, &at.join(name)).unwrap();
        let (folder, _) = RunFolder::open(&made.checkpoint).unwrap();
        let says = folder.read_settings().unwrap().depth_net.uncertainty;
        let has = depth_of(&made).tensors.contains_key("uncertainty.bias");
        assert_eq!(says, has, "{name}");
        (has, made.lost_uncertainty)
    };
    assert_eq!(made("both", &sure[0], &sure[1]), (true, false));
    assert_eq!(made("first", &sure[0], &plain), (false, true));
    assert_eq!(made("second", &plain, &sure[0]), (false, true));
}

#[test]
fn weights_with_another_meaning_are_refused() {
    let at = tempfile::tempdir().unwrap();
    let at = at.path();
    let seen_by = |fy: f64| {
        move |findings: &mut TrainFindings| {
            findings.camera = Some(Intrinsics {
                fx: fy,
                fy,
                cx: 160.0,
                cy: 48.0,
                width: 320,
                height: 96,
            });
        }
    };
    let first = run((&at.join("first"), LAST), &LAYERS, STATE, |_, f| {
        seen_by(200.0)(f);
    });
    type Change = fn(&mut TrainConfig, &mut TrainFindings);
    let changes: [(&str, Change); 6] = [
        ("depth_net.range.max_m", |c, _| {
            c.depth_net.range.max_m = 70.0;
        }),
        ("depth_net.encoder.normalisation", |c, _| {
            c.depth_net.encoder.normalisation = InputNormalisation::Centred;
        }),
        ("depth_net.encoder.multi_grid", |c, _| {
            c.depth_net.encoder.multi_grid = [1, 2, 1];
        }),
        ("canonical_focal_px", |c, _| {
            c.canonical_focal_px = Some(300.0)
        }),
        ("focal length", |_, f| {
            f.camera.as_mut().unwrap().fy = 260.0;
        }),
        ("focal length", |_, f| f.camera = None),
    ];
    for (i, (key, change)) in changes.into_iter().enumerate() {
        let folder = at.join(i.to_string());
        let other = run((&folder, LAST), &LAYERS, STATE, |c, f| {
            seen_by(200.0)(f);
            change(c, f);
        });
        let refused = average(&[first.clone(), other.clone()], None, &at.join("no"));
        let Err(Error::NoMean { path, why }) = refused else {
            panic!("{key}: {refused:?}");
        };
        assert_eq!(path, other);
        assert!(why.to_string().contains(key), "{why}");
    }
    let shapes: [&[(&str, &[f32])]; 3] = [
        &[("depth.b", &[1.0, 2.0])],
        &[("depth.a", &[1.0])],
        &[("depth.a", &[1.0, 2.0]), ("depth.b", &[1.0])],
    ];
    for (i, tensors) in shapes.into_iter().enumerate() {
        let folder = at.join(format!("layers{i}"));
        let other = run((&folder, LAST), tensors, STATE, |_, f| seen_by(200.0)(f));
        let refused = average(&[first.clone(), other], None, &at.join("no"));
        let why = NoMean::Layers {
            name: if i == 1 { "a" } else { "b" }.into(),
        };
        let is_it =
            |e: &Error| matches!(e, Error::NoMean { why: found, .. } if i == 0 || *found == why);
        assert!(refused.as_ref().is_err_and(is_it), "{refused:?}");
    }
    let encoders = Checkpoint {
        encoders_only: true,
        ..STATE
    };
    let encoders = run((&at.join("encoders"), LAST), &LAYERS, encoders, |_, _| {});
    let refused = average(&[first, encoders], None, &at.join("no"));
    let why = NoMean::EncodersOnly;
    assert!(matches!(refused, Err(Error::NoMean { why: found, .. }) if found == why));
    assert!(!at.join("no").exists());
}
