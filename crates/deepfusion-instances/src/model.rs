use std::path::{Path, PathBuf};

use deepfusion_fs::FileError;
use deepfusion_onnx::runtime::{ForeignModel, Tensor, TensorInfo};
use image::RgbImage;

use crate::mask::in_size;
use crate::names::{name_of, of_note};
use crate::{
    Colours, Error, Kind, Layout, Letterbox, Mask, Prototypes, Result, ShapeProblem, decode,
    suppress,
};

/// Height and width of the input if a model leaves them open.
const OPEN_SIZE: usize = 640;
/// Greatest number of instances in one image.
const MOST: usize = 300;

/// An instance in an image.
#[derive(Debug, Clone, PartialEq)]
pub struct Instance {
    /// Name of its class.
    pub class: String,
    /// The model's score, 0 to 1.
    pub score: f32,
    /// Left, top, right, bottom, in pixels of the requested size.
    pub bounds: [f32; 4],
    /// Pixels of the instance; the whole box if the model has no masks.
    pub mask: Mask,
    /// Whether the mask is from the model; otherwise it is the box.
    pub drawn: bool,
}

/// Limits on the instances found.
#[derive(Debug, Clone, PartialEq)]
pub struct Limits {
    /// Least score of an instance.
    pub score: f32,
    /// Overlap (intersection over union) above which two boxes of one class are the same instance.
    pub overlap: f32,
    /// Names of the classes to find; empty for all.
    pub classes: Vec<String>,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            score: 0.35,
            overlap: 0.6,
            classes: Vec::new(),
        }
    }
}

/// A segmentation or detection model of one of the known kinds ([`Kind`]).
#[derive(Debug)]
pub struct InstanceModel {
    path: PathBuf,
    model: ForeignModel,
    /// Height and width of the input.
    input: [usize; 2],
    layout: Layout,
    names: Vec<String>,
    limits: Limits,
}

impl InstanceModel {
    /// Loads a model. The ONNX Runtime `library` is searched for if none is given. `threads` is the number of CPU threads per run; 0 lets
    /// the library choose.
    ///
    /// # Errors
    /// [`Error::File`]; [`Error::Runtime`] if there is no library or it refuses the model; [`Error::Shape`] if inputs and outputs match no
    /// known kind; [`Error::Class`] for a class that the model does not have.
    pub fn load(
        path: &Path,
        library: Option<&Path>,
        threads: usize,
        limits: Limits,
    ) -> Result<Self> {
        let bytes = std::fs::read(path).map_err(|source| FileError::new(path, source))?;
        let failed = |source| Error::Runtime {
            path: path.to_owned(),
            source,
        };
        let mut model = ForeignModel::load(library, &bytes, threads).map_err(failed)?;
        let shape = |reason| Error::Shape {
            path: path.to_owned(),
            reason,
        };
        let input = input_size(&model.inputs()).map_err(shape)?;
        if let Some(output) = model.outputs().iter().find(|o| !o.f32) {
            return Err(shape(ShapeProblem::OutputNumbers {
                name: output.name.clone(),
            }));
        }
        // Exports often leave dimensions open, so only a run shows the shapes.
        let grey = vec![0.5; 3 * input[0] * input[1]];
        let outputs = model
            .run(&[1, 3, input[0], input[1]], &grey)
            .map_err(failed)?;
        let shapes: Vec<Vec<usize>> = outputs.into_iter().map(|tensor| tensor.shape).collect();
        let layout = Layout::of(input, &shapes).map_err(shape)?;
        let names = model.note("names").and_then(|note| of_note(&note));
        let names = names.unwrap_or_default();
        let classes = layout.classes.max(names.len());
        let known: Vec<String> = (0..classes).map(|c| name_of(&names, classes, c)).collect();
        if let Some(class) = limits.classes.iter().find(|class| !known.contains(class)) {
            return Err(Error::Class {
                path: path.to_owned(),
                class: class.clone(),
                known,
            });
        }
        Ok(Self {
            path: path.to_owned(),
            model,
            input,
            layout,
            names: known,
            limits,
        })
    }

    /// The layout of the model's outputs.
    #[must_use]
    pub fn layout(&self) -> &Layout {
        &self.layout
    }

    /// The instances in an image, by descending score. Boxes and masks are for an image of `size` (width, height) with the same content.
    ///
    /// # Errors
    /// [`Error::Runtime`]; [`Error::Shape`] if the outputs' shapes depend on the image's content.
    pub fn find(&mut self, image: &RgbImage, size: [usize; 2]) -> Result<Vec<Instance>> {
        let [height, width] = self.input;
        let colours = match self.layout.kind {
            Kind::GridRows => Colours::Bgr,
            Kind::Columns | Kind::Rows | Kind::Final => Colours::RgbToOne,
        };
        let from = [image.width() as usize, image.height() as usize];
        let letterbox = Letterbox::new(from, [width, height], colours);
        let outputs = self
            .model
            .run(&[1, 3, height, width], &letterbox.fill(image, colours))
            .map_err(|source| Error::Runtime {
                path: self.path.clone(),
                source,
            })?;
        let shapes: Vec<Vec<usize>> = outputs.iter().map(|tensor| tensor.shape.clone()).collect();
        // A model that suppresses candidates itself may return fewer rows for another image.
        let layout = Layout::of(self.input, &shapes)
            .ok()
            .filter(|layout| layout.kind == self.layout.kind)
            .ok_or_else(|| Error::Shape {
                path: self.path.clone(),
                reason: ShapeProblem::Changing,
            })?;
        let of_rank = |rank: usize| outputs.iter().find(|tensor| tensor.shape.len() == rank);
        let values = of_rank(3).map_or(&[][..], |tensor| &tensor.data);
        let wanted = |class: usize| {
            self.limits.classes.is_empty() || self.limits.classes.contains(&self.name(class))
        };
        let mut candidates = decode(&layout, self.input, values, self.limits.score);
        candidates.retain(|candidate| wanted(candidate.class));
        let candidates = suppress(candidates, self.limits.overlap, MOST);
        let prototypes = layout.prototypes.zip(of_rank(4));
        Ok(candidates
            .into_iter()
            .map(|candidate| {
                let bounds = in_size(candidate.bounds, &letterbox, size);
                let mask = prototypes.map(|(shape, Tensor { data, .. })| {
                    Prototypes {
                        shape,
                        values: data,
                    }
                    .mask(&candidate, &letterbox, size)
                });
                Instance {
                    class: self.name(candidate.class),
                    score: candidate.score,
                    bounds,
                    drawn: mask.is_some(),
                    mask: mask.unwrap_or_else(|| Mask::of_box(bounds, size)),
                }
            })
            .collect())
    }

    fn name(&self, class: usize) -> String {
        name_of(&self.names, self.names.len(), class)
    }
}

/// Height and width of the only input, an image of three planes.
fn input_size(inputs: &[TensorInfo]) -> std::result::Result<[usize; 2], ShapeProblem> {
    let [input] = inputs else {
        return Err(ShapeProblem::Inputs {
            found: inputs.len(),
        });
    };
    match input.shape[..] {
        [None | Some(1), None | Some(3), height, width] if input.f32 => {
            Ok([height.unwrap_or(OPEN_SIZE), width.unwrap_or(OPEN_SIZE)])
        }
        _ => Err(ShapeProblem::Input {
            input: input.clone(),
        }),
    }
}
