//! Compared with the results of the detectors' own programs for the same numbers (tests/reference/generate.py).

use deepfusion_instances::{
    Colours, Kind, Layout, Letterbox, Prototypes, decode, in_size, suppress,
};
use ndarray::{ArrayD, Ix2, Ix3};
use ndarray_npy::NpzReader;

const SCORE: f32 = 0.35;
const OVERLAP: f32 = 0.6;

struct Fixture(NpzReader<std::fs::File>);

impl Fixture {
    fn open() -> Self {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/reference/reference.npz");
        Self(NpzReader::new(std::fs::File::open(path).unwrap()).unwrap())
    }

    fn floats(&mut self, name: &str) -> ArrayD<f32> {
        self.0.by_name(name).unwrap()
    }

    /// Height and width.
    fn size(&mut self, name: &str) -> [usize; 2] {
        let values: ArrayD<i64> = self.0.by_name(name).unwrap();
        [values[0] as usize, values[1] as usize]
    }
}

/// Compares the results for one kind of model; returns the number of instances.
fn check(name: &str, kind: Kind, colours: Colours) -> usize {
    let mut fixture = Fixture::open();
    let (input, image) = (fixture.size("input"), fixture.size("image"));
    let (size, letterbox) = (
        [image[1], image[0]],
        Letterbox::new([image[1], image[0]], [input[1], input[0]], colours),
    );
    let ratio = (input[0] as f32 / image[0] as f32).min(input[1] as f32 / image[1] as f32);
    let predictions = fixture.floats(&format!("{name}_predictions"));
    let with_masks = kind != Kind::GridRows;
    let prototypes = with_masks.then(|| fixture.floats(&format!("{name}_prototypes")));
    let shapes: Vec<Vec<usize>> = [Some(&predictions), prototypes.as_ref()]
        .into_iter()
        .flatten()
        .map(|a| a.shape().to_vec())
        .collect();
    let layout = Layout::of(input, &shapes).unwrap();
    assert_eq!(layout.kind, kind);
    let found = decode(&layout, input, predictions.as_slice().unwrap(), SCORE);
    let mut found = suppress(found, OVERLAP, 300);

    let boxes = fixture.floats(&format!("{name}_boxes"));
    let boxes = boxes.into_dimensionality::<Ix2>().unwrap();
    let classes = fixture.floats(&format!("{name}_classes"));
    let scores = fixture.floats(&format!("{name}_scores"));
    let masks: Option<ndarray::Array3<u8>> = with_masks.then(|| {
        let masks: ArrayD<u8> = fixture.0.by_name(&format!("{name}_masks")).unwrap();
        masks.into_dimensionality::<Ix3>().unwrap()
    });
    assert_eq!(found.len(), boxes.nrows());
    for (i, expected) in boxes.rows().into_iter().enumerate() {
        // YOLOX's program returns its results class by class, so match each box with the nearest one.
        let off = |bounds: [f32; 4]| {
            let [l, t, ..] = expected.to_vec()[..] else {
                unreachable!()
            };
            (bounds[0] - l).abs() + (bounds[1] - t).abs()
        };
        let in_image = |bounds: [f32; 4]| {
            if with_masks {
                in_size(bounds, &letterbox, size)
            } else {
                // YOLOX's program divides by one ratio and does not clip boxes at the edge of the image.
                bounds.map(|b| b / ratio)
            }
        };
        let nearest = (0..found.len())
            .min_by(|a, b| {
                off(in_image(found[*a].bounds)).total_cmp(&off(in_image(found[*b].bounds)))
            })
            .unwrap();
        let candidate = found.swap_remove(nearest);
        let bounds = in_image(candidate.bounds);
        for k in 0..4 {
            assert!(
                (bounds[k] - expected[k]).abs() < 0.01,
                "{i}: {bounds:?} {expected}"
            );
        }
        assert_eq!(candidate.class as f32, classes[i]);
        let (Some(masks), Some(prototypes)) = (&masks, &prototypes) else {
            continue;
        };
        assert!((candidate.score - scores[i]).abs() < 1e-6);
        let prototypes = Prototypes {
            shape: layout.prototypes.unwrap(),
            values: prototypes.as_slice().unwrap(),
        };
        let mask = prototypes.mask(&candidate, &letterbox, size);
        let mut ours = ndarray::Array2::<u8>::zeros((image[0], image[1]));
        for [v, from, to] in mask.runs {
            for u in from..to {
                ours[[v as usize, u as usize]] = 1;
            }
        }
        // The reference masks are clipped to whole cells and whole pixels, so edges may differ by a pixel.
        let theirs = masks.index_axis(ndarray::Axis(0), i);
        let count = |f: fn(u8, u8) -> bool| {
            ours.iter().zip(theirs).filter(|(a, b)| f(**a, **b)).count() as f32
        };
        let (both, either) = (count(|a, b| a & b == 1), count(|a, b| a | b == 1));
        assert!(
            either > 20.0 && both / either > 0.9,
            "{name} {i}: {both} of {either}"
        );
    }
    boxes.nrows()
}

#[test]
fn masks_match_ultralytics() {
    assert!(check("columns", Kind::Columns, Colours::RgbToOne) > 6);
    assert!(check("final", Kind::Final, Colours::RgbToOne) > 6);
}

#[test]
fn boxes_match_yolox() {
    assert!(check("grid_rows", Kind::GridRows, Colours::Bgr) > 6);
}

#[test]
fn values_that_are_not_finite_give_no_candidates() {
    let layout = Layout::of([64, 96], &[vec![1, 7, 126]]).unwrap();
    let mut values = vec![0.0; 7 * 126];
    for i in 0..126 {
        values[4 * 126 + i] = 0.9;
        values[2 * 126 + i] = f32::NAN;
    }
    values[4 * 126] = f32::NAN;
    values[126 - 1] = f32::INFINITY;
    assert!(decode(&layout, [64, 96], &values, SCORE).is_empty());
}
