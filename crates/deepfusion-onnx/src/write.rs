//! [`DepthModel`] → ONNX.

mod composed;
mod convolution;

use std::collections::HashSet;

use deepfusion_infer::{Node, Op, ValueId};
use deepfusion_kernels::position_code;
use prost::Message;

use crate::model::CANONICAL;
use crate::proto::{
    AttributeProto, FLOAT, GraphProto, ModelProto, NodeProto, OperatorSetIdProto,
    StringStringEntryProto, TensorProto, UINT8, ValueInfoProto,
};
use crate::{DepthModel, Error, NodeProblem, OPSET};

/// Version of the file layout: the first that supports [`OPSET`].
pub(crate) const IR_VERSION: i64 = 8;

/// Largest size of a protobuf message, bytes.
const MOST_BYTES: usize = i32::MAX as usize;

/// The model as an ONNX file.
///
/// - input `image`: bytes, 1×H×W×3, RGB. Normalisation and layout are part of the file; resizing is not.
/// - output `depth`: f32, 1×1×H×W, camera z in metres.
/// - output `disparity`: f32, 1×1×H×W, 1 / depth, in 1/m.
///
/// Nodes, their outputs and their weights have the names of the network's layers. The metadata holds the
/// range, the camera trained with and the program's version.
///
/// # Errors
/// As [`DepthModel::validate`]; [`Error::Node`] for a name that occurs twice, [`Error::TooLarge`].
pub fn write(model: &DepthModel) -> Result<Vec<u8>, Error> {
    let proto = encode(model)?;
    let bytes = proto.encoded_len();
    if bytes > MOST_BYTES {
        return Err(too_large(bytes));
    }
    Ok(proto.encode_to_vec())
}

fn too_large(bytes: usize) -> Error {
    Error::TooLarge {
        bytes,
        most: MOST_BYTES,
    }
}

/// The model as a protobuf message.
pub(crate) fn encode(model: &DepthModel) -> Result<ModelProto, Error> {
    model.validate()?;
    // Checked before the weights are copied.
    let weights = model.graph.nodes().iter().map(|node| match &node.op {
        Op::Conv(conv) => 4 * (conv.weight.len() + conv.bias.len()),
        Op::Depthwise(op) => 4 * (op.weight.len() + op.bias.len()),
        Op::Position { per_axis, halvings } => {
            let sides = [*per_axis, model.width >> halvings, model.height >> halvings];
            sides.into_iter().fold(8, usize::saturating_mul)
        }
        _ => 0,
    });
    let bytes = weights.fold(0, usize::saturating_add);
    if bytes > MOST_BYTES {
        return Err(too_large(bytes));
    }
    let shapes = (0..=model.graph.nodes().len()).map(|value| {
        let shape = model.graph.shape(ValueId(value));
        let (width, height) = shape.size(model.width, model.height);
        [shape.channels, height, width]
    });
    let mut writer = Writer {
        shapes: shapes.collect(),
        ..Writer::default()
    };
    writer.taken.insert("image".into());
    writer.image(model)?;
    for node in model.graph.nodes() {
        writer.node(node)?;
    }
    writer.depth(model)?;
    let (w, h) = (model.width, model.height);
    let version = env!("CARGO_PKG_VERSION");
    let graph = GraphProto {
        node: writer.nodes,
        name: "depth".into(),
        initializer: writer.initializers,
        input: vec![ValueInfoProto::array(
            "image",
            UINT8,
            [1, h, w, 3],
            "RGB picture, resized (Lanczos) to this size",
        )],
        output: vec![
            ValueInfoProto::array(
                "depth",
                FLOAT,
                [1, 1, h, w],
                if model.canonical {
                    "camera z in metres of a camera with the canonical focal length"
                } else {
                    "camera z in metres"
                },
            ),
            ValueInfoProto::array("disparity", FLOAT, [1, 1, h, w], "1 / depth, in 1/m"),
        ],
    };
    Ok(ModelProto {
        ir_version: IR_VERSION,
        opset_import: vec![OperatorSetIdProto {
            domain: String::new(),
            version: OPSET,
        }],
        producer_name: "deepfusion".into(),
        producer_version: version.into(),
        doc_string: if model.canonical {
            "Metric depth from one RGB picture, resized but not cropped. For every camera, multiply depth by its f_y, in pixels of the \
             resized picture, over the metadata's canonical_fy_px."
        } else {
            "Metric depth from one RGB picture. For a camera other than the one trained with, multiply depth \
            by f_y of that camera, in pixels of the resized picture, over the metadata's training_fy_px."
        }
        .into(),
        graph: Some(graph),
        metadata_props: metadata(model, version),
    })
}

fn metadata(model: &DepthModel, version: &str) -> Vec<StringStringEntryProto> {
    let mut entries = vec![
        ("program", "deepfusion".to_owned()),
        ("program_version", version.to_owned()),
        ("depth_unit", "m".to_owned()),
    ];
    if let Some(focal) = model.trained_with {
        entries.push(("training_fx_px", focal.fx.to_string()));
        entries.push(("training_fy_px", focal.fy.to_string()));
        if model.canonical {
            entries.push((CANONICAL, focal.fy.to_string()));
        }
    }
    // Required entries come last, so that a file that ends early is never taken as complete.
    entries.push(("depth_min_m", model.range.min_m.to_string()));
    entries.push(("depth_max_m", model.range.max_m.to_string()));
    let entry = |(key, value): (&str, String)| StringStringEntryProto {
        key: key.to_owned(),
        value,
    };
    entries.into_iter().map(entry).collect()
}

fn along_channels() -> Vec<AttributeProto> {
    vec![AttributeProto::int("axis", 1)]
}

#[derive(Default)]
struct Writer {
    /// Channels, height and width of each value of the graph.
    shapes: Vec<[usize; 3]>,
    nodes: Vec<NodeProto>,
    initializers: Vec<TensorProto>,
    /// All names in use, of node outputs and constants.
    taken: HashSet<String>,
    /// The name of each value of the graph.
    values: Vec<String>,
}

impl Writer {
    /// Adds a node; its output has its name.
    fn emit(
        &mut self,
        op: &str,
        name: &str,
        inputs: &[&str],
        attribute: Vec<AttributeProto>,
    ) -> Result<String, Error> {
        if name.is_empty() || !self.taken.insert(name.to_owned()) {
            return Err(Error::Node {
                name: name.into(),
                op: op.into(),
                reason: NodeProblem::Name,
            });
        }
        self.nodes.push(NodeProto {
            input: inputs.iter().map(|i| (*i).to_owned()).collect(),
            output: vec![name.to_owned()],
            name: name.to_owned(),
            op_type: op.to_owned(),
            attribute,
            domain: String::new(),
        });
        Ok(name.to_owned())
    }

    /// Adds a constant for the node called `node`.
    fn constant(&mut self, node: &str, tensor: TensorProto) -> Result<String, Error> {
        let name = tensor.name.clone();
        if !self.taken.insert(name.clone()) {
            return Err(Error::Node {
                name: node.into(),
                op: "constant".into(),
                reason: NodeProblem::ConstantName { name },
            });
        }
        self.initializers.push(tensor);
        Ok(name)
    }

    /// Adds a convolution's weights. A recurrent network's layers run several times: their weights are in the file once.
    fn weight(&mut self, node: &str, tensor: TensorProto) -> Result<String, Error> {
        let same =
            |other: &&TensorProto| other.dims == tensor.dims && other.raw_data == tensor.raw_data;
        match self.initializers.iter().find(same) {
            Some(other) => Ok(other.name.clone()),
            None => self.constant(node, tensor),
        }
    }

    /// Adds a constant that many nodes share.
    fn shared(&mut self, tensor: TensorProto) -> Result<String, Error> {
        if self.initializers.contains(&tensor) {
            return Ok(tensor.name);
        }
        let name = tensor.name.clone();
        self.constant(&name, tensor)
    }

    /// Bytes 1×H×W×3 → (x/255 − mean) / std, 1×3×H×W.
    fn image(&mut self, model: &DepthModel) -> Result<(), Error> {
        let perm = vec![AttributeProto::ints("perm", &[0, 3, 1, 2])];
        let x = self.emit("Transpose", "image.planes", &["image"], perm)?;
        let to = vec![AttributeProto::int("to", i64::from(FLOAT))];
        let x = self.emit("Cast", "image.float", &[&x], to)?;
        let full = TensorProto::floats("image.full", &[], &[255.0]);
        let full = self.constant("image.unit", full)?;
        let x = self.emit("Div", "image.unit", &[&x, &full], vec![])?;
        let mean = TensorProto::floats("image.mean", &[1, 3, 1, 1], &model.graph.mean());
        let mean = self.constant("image.centred", mean)?;
        let x = self.emit("Sub", "image.centred", &[&x, &mean], vec![])?;
        let std = TensorProto::floats("image.std", &[1, 3, 1, 1], &model.graph.std());
        let std = self.constant("image.normalised", std)?;
        let x = self.emit("Div", "image.normalised", &[&x, &std], vec![])?;
        self.values.push(x);
        Ok(())
    }

    /// σ → 1/D_max + (1/D_min − 1/D_max)·σ → the reciprocal of that.
    fn depth(&mut self, model: &DepthModel) -> Result<(), Error> {
        let [far, span] = model.disparity_terms();
        let sigmoid = self.value(model.graph.outputs()[0]);
        let span = TensorProto::floats("disparity.span", &[], &[span]);
        let span = self.constant("disparity.above", span)?;
        let x = self.emit("Mul", "disparity.above", &[&sigmoid, &span], vec![])?;
        let far = TensorProto::floats("disparity.far", &[], &[far]);
        let far = self.constant("disparity", far)?;
        let x = self.emit("Add", "disparity", &[&x, &far], vec![])?;
        self.emit("Reciprocal", "depth", &[&x], vec![])?;
        Ok(())
    }

    fn value(&self, value: ValueId) -> String {
        self.values[value.0].clone()
    }

    fn node(&mut self, node: &Node) -> Result<(), Error> {
        let name = node.name.as_str();
        let value = match &node.op {
            Op::Conv(conv) => self.conv(name, conv)?,
            Op::Depthwise(op) => self.depthwise(name, op)?,
            Op::Enlarge { input } => {
                let attributes = vec![
                    AttributeProto::text("coordinate_transformation_mode", "half_pixel"),
                    AttributeProto::text("mode", "linear"),
                ];
                let scales = self.doubling()?;
                self.emit(
                    "Resize",
                    name,
                    &[&self.value(*input), "", &scales],
                    attributes,
                )?
            }
            Op::ChannelNorm { input, epsilon } => self.channel_norm(name, *input, *epsilon)?,
            Op::CrossCovariance { input, temperature } => {
                self.cross_covariance(name, *input, temperature)?
            }
            Op::Position { per_axis, .. } => {
                let [channels, height, width] = self.shapes[self.values.len()];
                let code = position_code(*per_axis, height, width);
                let dims = [1, channels, height, width];
                let code = TensorProto::floats(&format!("{name}.code"), &dims, &code);
                let code = self.constant(name, code)?;
                self.emit("Identity", name, &[&code], vec![])?
            }
            Op::MaxPool { input } => {
                let attributes = vec![
                    AttributeProto::ints("kernel_shape", &[3, 3]),
                    AttributeProto::ints("pads", &[1; 4]),
                    AttributeProto::ints("strides", &[2, 2]),
                ];
                self.emit("MaxPool", name, &[&self.value(*input)], attributes)?
            }
            Op::UpsampleConcat { input, skip } => self.upsample(name, *input, *skip)?,
            Op::Concat { inputs } => {
                let inputs: Vec<_> = inputs.iter().map(|input| self.value(*input)).collect();
                let inputs: Vec<_> = inputs.iter().map(String::as_str).collect();
                self.emit("Concat", name, &inputs, along_channels())?
            }
            Op::GlobalMean { input } => {
                self.emit("GlobalAveragePool", name, &[&self.value(*input)], vec![])?
            }
            Op::ChannelExtent { input } => {
                let x = self.value(*input);
                let mut reduce = |op: &str, name: String| {
                    let axes = AttributeProto::ints("axes", &[1]);
                    let attributes = vec![axes, AttributeProto::int("keepdims", 1)];
                    self.emit(op, &name, &[&x], attributes)
                };
                let mean = reduce("ReduceMean", format!("{name}.mean"))?;
                let most = reduce("ReduceMax", format!("{name}.max"))?;
                self.emit("Concat", name, &[&mean, &most], along_channels())?
            }
            Op::Gate {
                input,
                spatial,
                channel,
                residual,
            } => {
                let [x, spatial, channel] = [input, spatial, channel].map(|v| self.value(*v));
                let mask = format!("{name}.mask");
                let mut mask = self.emit("Mul", &mask, &[&spatial, &channel], vec![])?;
                if *residual {
                    let one = self.shared(TensorProto::floats("one", &[], &[1.0]))?;
                    mask = self.emit("Add", &format!("{name}.pass"), &[&mask, &one], vec![])?;
                }
                self.emit("Mul", name, &[&x, &mask], vec![])?
            }
            Op::AddPixel { input, pixel } => {
                let [x, pixel] = [input, pixel].map(|v| self.value(*v));
                self.emit("Add", name, &[&x, &pixel], vec![])?
            }
            Op::Multiply { inputs } => {
                let [a, b] = inputs.map(|v| self.value(v));
                self.emit("Mul", name, &[&a, &b], vec![])?
            }
            // h + z·(q − h).
            Op::Blend {
                state,
                candidate,
                share,
            } => {
                let [h, q, z] = [state, candidate, share].map(|v| self.value(*v));
                let way = self.emit("Sub", &format!("{name}.way"), &[&q, &h], vec![])?;
                let step = self.emit("Mul", &format!("{name}.step"), &[&z, &way], vec![])?;
                self.emit("Add", name, &[&h, &step], vec![])?
            }
            Op::ConvexUpsample { input, weights, .. } => self.convex(name, *input, *weights)?,
            Op::DepthToSpace { input } => self.depth_to_space(name, *input)?,
        };
        self.values.push(value);
        Ok(())
    }
}
