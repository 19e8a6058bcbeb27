//! [`DepthModel`] → ONNX.

use std::collections::HashSet;

use deepfusion_infer::{Activation, Border, Conv, Depthwise, Node, Op, ValueId};
use deepfusion_kernels::position_code;
use prost::Message;

use crate::model::CANONICAL;
use crate::proto::{
    AttributeProto, FLOAT, GraphProto, ModelProto, NodeProto, OperatorSetIdProto,
    StringStringEntryProto, TensorProto, UINT8, ValueInfoProto,
};
use crate::{DepthModel, Error, NodeProblem, OPSET};

/// Version of the file layout; the first that holds [`OPSET`].
pub(crate) const IR_VERSION: i64 = 8;

/// A message of protobuf cannot be larger.
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

/// The model as a message.
pub(crate) fn encode(model: &DepthModel) -> Result<ModelProto, Error> {
    model.validate()?;
    // Before the weights are copied.
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
            "Metric depth from one RGB picture, shown whole. For every camera multiply depth by its f_y, in pixels of the \
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
    // What must be there stands last: a file that ends early is then never taken for a whole one.
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
    /// Adds a node; what it gives bears its name.
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

    /// A convolution's weights. A recurrent network's layers run several times: their weights are in the file once.
    fn weight(&mut self, node: &str, tensor: TensorProto) -> Result<String, Error> {
        let same =
            |other: &&TensorProto| other.dims == tensor.dims && other.raw_data == tensor.raw_data;
        match self.initializers.iter().find(same) {
            Some(other) => Ok(other.name.clone()),
            None => self.constant(node, tensor),
        }
    }

    /// A constant that many nodes share.
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

    /// σ → 1/D_max + (1/D_min − 1/D_max)·σ → 1 / that.
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

    /// Whole, and then cut where the larger size is an odd number of pixels.
    fn depth_to_space(&mut self, name: &str, input: ValueId) -> Result<String, Error> {
        let [_, height, width] = self.shapes[self.values.len()];
        let [_, small_height, small_width] = self.shapes[input.0];
        let attributes = vec![
            AttributeProto::int("blocksize", 2),
            AttributeProto::text("mode", "DCR"),
        ];
        let input = self.value(input);
        if [height, width] == [2 * small_height, 2 * small_width] {
            return self.emit("DepthToSpace", name, &[&input], attributes);
        }
        let whole = format!("{name}.whole");
        let whole = self.emit("DepthToSpace", &whole, &[&input], attributes)?;
        let starts = self.shared(TensorProto::ints("cut.starts", &[0, 0]))?;
        let axes = self.shared(TensorProto::ints("cut.axes", &[2, 3]))?;
        let ends = TensorProto::ints(&format!("{name}.ends"), &[height as i64, width as i64]);
        let ends = self.constant(name, ends)?;
        self.emit("Slice", name, &[&whole, &starts, &ends, &axes], vec![])
    }

    fn upsample(
        &mut self,
        name: &str,
        input: ValueId,
        skip: Option<ValueId>,
    ) -> Result<String, Error> {
        let scales = self.doubling()?;
        let attributes = vec![
            AttributeProto::text("coordinate_transformation_mode", "asymmetric"),
            AttributeProto::text("mode", "nearest"),
            AttributeProto::text("nearest_mode", "floor"),
        ];
        let input = self.value(input);
        // The second input, a region of interest, is for another mode.
        let inputs = [input.as_str(), "", &scales];
        let Some(skip) = skip else {
            return self.emit("Resize", name, &inputs, attributes);
        };
        let large = self.emit("Resize", &format!("{name}.resize"), &inputs, attributes)?;
        self.emit(
            "Concat",
            name,
            &[&large, &self.value(skip)],
            along_channels(),
        )
    }

    /// The factors of a Resize that doubles width and height.
    fn doubling(&mut self) -> Result<String, Error> {
        let scales = TensorProto::floats("resize.scales", &[4], &[1.0, 1.0, 2.0, 2.0]);
        self.shared(scales)
    }

    fn depthwise(&mut self, name: &str, op: &Depthwise) -> Result<String, Error> {
        let channels = op.bias.len();
        let dims = [channels, 1, op.kernel, op.kernel];
        let weight = TensorProto::floats(&format!("{name}.weight"), &dims, &op.weight);
        let weight = self.constant(name, weight)?;
        let bias = TensorProto::floats(&format!("{name}.bias"), &dims[..1], &op.bias);
        let bias = self.constant(name, bias)?;
        let attributes = vec![
            AttributeProto::ints("kernel_shape", &[op.kernel as i64; 2]),
            AttributeProto::ints("pads", &[op.reach() as i64; 4]),
            AttributeProto::ints("strides", &[op.stride as i64; 2]),
            AttributeProto::ints("dilations", &[op.dilation as i64; 2]),
            AttributeProto::int("group", channels as i64),
        ];
        self.emit(
            "Conv",
            name,
            &[&self.value(op.input), &weight, &bias],
            attributes,
        )
    }

    /// Spelt out: `LayerNormalization` knows the last axes alone.
    fn channel_norm(&mut self, name: &str, input: ValueId, epsilon: f32) -> Result<String, Error> {
        let x = self.value(input);
        let over_channels = || {
            let axes = AttributeProto::ints("axes", &[1]);
            vec![axes, AttributeProto::int("keepdims", 1)]
        };
        let mean = self.emit(
            "ReduceMean",
            &format!("{name}.mean"),
            &[&x],
            over_channels(),
        )?;
        let centred = self.emit("Sub", &format!("{name}.centred"), &[&x, &mean], vec![])?;
        let square = format!("{name}.square");
        let square = self.emit("Mul", &square, &[&centred, &centred], vec![])?;
        let variance = format!("{name}.variance");
        let variance = self.emit("ReduceMean", &variance, &[&square], over_channels())?;
        let small = TensorProto::floats(&format!("{name}.epsilon"), &[], &[epsilon]);
        let small = self.constant(name, small)?;
        let above = format!("{name}.above");
        let above = self.emit("Add", &above, &[&variance, &small], vec![])?;
        let deviation = self.emit("Sqrt", &format!("{name}.deviation"), &[&above], vec![])?;
        self.emit("Div", name, &[&centred, &deviation], vec![])
    }

    fn cross_covariance(
        &mut self,
        name: &str,
        input: ValueId,
        temperature: &[f32],
    ) -> Result<String, Error> {
        let heads = temperature.len();
        let x = self.value(input);
        let [channels, height, width] = self.shapes[input.0].map(|side| side as i64);
        let shape = [3, heads as i64, -1, height * width];
        let shape = TensorProto::ints(&format!("{name}.shape"), &shape);
        let shape = self.constant(name, shape)?;
        let apart = self.emit("Reshape", &format!("{name}.heads"), &[&x, &shape], vec![])?;
        let mut part = |index: i64, what: &str| {
            let at = TensorProto::ints(&format!("at.{index}"), &[index]);
            let at = self.shared(at)?;
            let axis = vec![AttributeProto::int("axis", 0)];
            self.emit("Gather", &format!("{name}.{what}"), &[&apart, &at], axis)
        };
        let (queries, keys) = (part(0, "queries")?, part(1, "keys")?);
        let values = part(2, "values")?;
        let queries = self.unit(&queries)?;
        let keys = self.unit(&keys)?;
        let perm = vec![AttributeProto::ints("perm", &[0, 1, 3, 2])];
        let turned = self.emit("Transpose", &format!("{name}.turned"), &[&keys], perm)?;
        let similar = format!("{name}.similar");
        let similar = self.emit("MatMul", &similar, &[&queries, &turned], vec![])?;
        let factor = TensorProto::floats(
            &format!("{name}.temperature"),
            &[1, heads, 1, 1],
            temperature,
        );
        let factor = self.constant(name, factor)?;
        let scaled = self.emit(
            "Mul",
            &format!("{name}.scaled"),
            &[&similar, &factor],
            vec![],
        )?;
        let last = vec![AttributeProto::int("axis", -1)];
        let shares = self.emit("Softmax", &format!("{name}.shares"), &[&scaled], last)?;
        let mixed = self.emit(
            "MatMul",
            &format!("{name}.mixed"),
            &[&shares, &values],
            vec![],
        )?;
        let whole = [1, channels / 3, height, width];
        let whole = TensorProto::ints(&format!("{name}.whole"), &whole);
        let whole = self.constant(name, whole)?;
        self.emit("Reshape", name, &[&mixed, &whole], vec![])
    }

    /// Rows to length 1.
    fn unit(&mut self, x: &str) -> Result<String, Error> {
        let squares = self.emit("Mul", &format!("{x}.square"), &[x, x], vec![])?;
        let axis = self.shared(TensorProto::ints("last", &[-1]))?;
        let keep = vec![AttributeProto::int("keepdims", 1)];
        let sum = self.emit("ReduceSum", &format!("{x}.sum"), &[&squares, &axis], keep)?;
        let least = self.shared(TensorProto::floats("least", &[], &[1e-24]))?;
        let above = self.emit("Add", &format!("{x}.above"), &[&sum, &least], vec![])?;
        let length = self.emit("Sqrt", &format!("{x}.length"), &[&above], vec![])?;
        self.emit("Div", &format!("{x}.unit"), &[x, &length], vec![])
    }

    /// The nine neighbours of each pixel by a convolution that picks one each, times the softmax of their weights.
    fn convex(&mut self, name: &str, input: ValueId, weights: ValueId) -> Result<String, Error> {
        let [_, height, width] = self.shapes[input.0].map(|side| side as i64);
        let block = self.shapes[weights.0][0] as i64 / 9;
        let side = block.isqrt();
        let (value, weights) = (self.value(input), self.value(weights));
        let reshape = |writer: &mut Self, x: &str, to: &str, dims: &[i64]| {
            let of = TensorProto::ints(&format!("{to}.shape"), dims);
            let of = writer.constant(to, of)?;
            writer.emit("Reshape", to, &[x, &of], vec![])
        };
        let apart = format!("{name}.apart");
        let apart = reshape(self, &weights, &apart, &[9, block, height, width])?;
        let over_taps = vec![AttributeProto::int("axis", 0)];
        let shares = self.emit("Softmax", &format!("{name}.shares"), &[&apart], over_taps)?;
        let picks: Vec<f32> = (0..81).map(|i| f32::from(u8::from(i % 10 == 0))).collect();
        let picks = self.shared(TensorProto::floats("neighbours", &[9, 1, 3, 3], &picks))?;
        let window = vec![
            AttributeProto::ints("kernel_shape", &[3; 2]),
            AttributeProto::ints("pads", &[1; 4]),
        ];
        let taps = self.emit("Conv", &format!("{name}.taps"), &[&value, &picks], window)?;
        let around = reshape(
            self,
            &taps,
            &format!("{name}.around"),
            &[9, 1, height, width],
        )?;
        let weighted = format!("{name}.weighted");
        let weighted = self.emit("Mul", &weighted, &[&shares, &around], vec![])?;
        let first = self.shared(TensorProto::ints("at.0", &[0]))?;
        let drop = vec![AttributeProto::int("keepdims", 0)];
        let sum = self.emit(
            "ReduceSum",
            &format!("{name}.sum"),
            &[&weighted, &first],
            drop,
        )?;
        let blocks = format!("{name}.blocks");
        let blocks = reshape(self, &sum, &blocks, &[side, side, height, width])?;
        let perm = vec![AttributeProto::ints("perm", &[2, 0, 3, 1])];
        let turned = self.emit("Transpose", &format!("{name}.turned"), &[&blocks], perm)?;
        reshape(self, &turned, name, &[1, 1, side * height, side * width])
    }

    fn conv(&mut self, name: &str, conv: &Conv) -> Result<String, Error> {
        let half = conv.reach() as i64;
        let mut x = self.value(conv.input);
        let mut pads = [half; 4];
        if conv.border == Border::Reflect {
            let amounts = [0, 0, half, half, 0, 0, half, half];
            let amounts = self.shared(TensorProto::ints(&format!("pads.{half}"), &amounts))?;
            let mode = vec![AttributeProto::text("mode", "reflect")];
            x = self.emit("Pad", &format!("{name}.pad"), &[&x, &amounts], mode)?;
            pads = [0; 4];
        }
        let dims = [
            conv.channels_out,
            conv.channels_in,
            conv.kernel,
            conv.kernel,
        ];
        let weight = TensorProto::floats(&format!("{name}.weight"), &dims, &conv.weight);
        let weight = self.weight(name, weight)?;
        let bias = TensorProto::floats(&format!("{name}.bias"), &dims[..1], &conv.bias);
        let bias = self.constant(name, bias)?;
        let mut attributes = vec![
            AttributeProto::ints("kernel_shape", &[conv.kernel as i64; 2]),
            AttributeProto::ints("pads", &pads),
            AttributeProto::ints("strides", &[conv.stride as i64; 2]),
        ];
        if conv.dilation > 1 {
            let taps = [conv.dilation as i64; 2];
            attributes.push(AttributeProto::ints("dilations", &taps));
        }
        x = self.emit("Conv", name, &[&x, &weight, &bias], attributes)?;
        if let Some(residual) = conv.residual {
            let residual = self.value(residual);
            x = self.emit("Add", &format!("{name}.add"), &[&x, &residual], vec![])?;
        }
        match conv.activation {
            Activation::Identity => Ok(x),
            Activation::Relu => self.emit("Relu", &format!("{name}.relu"), &[&x], vec![]),
            Activation::Sigmoid => self.sigmoid(name, &x),
            Activation::Gelu => self.gelu(name, &x),
            Activation::Tanh => self.emit("Tanh", &format!("{name}.tanh"), &[&x], vec![]),
            Activation::LeakyRelu => {
                let alpha = vec![AttributeProto::float("alpha", 0.01)];
                self.emit("LeakyRelu", &format!("{name}.leaky"), &[&x], alpha)
            }
            Activation::Elu => {
                let alpha = vec![AttributeProto::float("alpha", 1.0)];
                self.emit("Elu", &format!("{name}.elu"), &[&x], alpha)
            }
        }
    }

    /// x·½·(1 + erf(x/√2)), spelt out: this operator set has no `Gelu`, and ONNX Runtime makes one operation of it.
    fn gelu(&mut self, name: &str, x: &str) -> Result<String, Error> {
        let root = TensorProto::floats("root", &[], &[std::f32::consts::SQRT_2]);
        let (root, one) = (self.shared(root)?, TensorProto::floats("one", &[], &[1.0]));
        let (one, half) = (self.shared(one)?, TensorProto::floats("half", &[], &[0.5]));
        let half = self.shared(half)?;
        let y = self.emit("Div", &format!("{name}.over_root"), &[x, &root], vec![])?;
        let y = self.emit("Erf", &format!("{name}.erf"), &[&y], vec![])?;
        let y = self.emit("Add", &format!("{name}.erf_plus_one"), &[&y, &one], vec![])?;
        let y = self.emit("Mul", &format!("{name}.twice"), &[x, &y], vec![])?;
        self.emit("Mul", &format!("{name}.gelu"), &[&y, &half], vec![])
    }

    /// 1 / (1 + e⁻ˣ), spelt out: ONNX Runtime's `Sigmoid` is off by up to 1.4e-7 where it should be 0, which
    /// is 1e-4 of the depth at 90 m. This is as exact there as anywhere, for one channel's work.
    fn sigmoid(&mut self, name: &str, x: &str) -> Result<String, Error> {
        let one = self.shared(TensorProto::floats("one", &[], &[1.0]))?;
        let x = self.emit("Neg", &format!("{name}.negative"), &[x], vec![])?;
        let x = self.emit("Exp", &format!("{name}.exp"), &[&x], vec![])?;
        let x = self.emit("Add", &format!("{name}.plus_one"), &[&x, &one], vec![])?;
        self.emit("Reciprocal", &format!("{name}.sigmoid"), &[&x], vec![])
    }
}
