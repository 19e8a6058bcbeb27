//! ONNX → [`DepthModel`], for files that [`write`](crate::write()) wrote.

use std::collections::HashMap;
use std::iter::Peekable;
use std::slice::Iter;

use deepfusion_geometry::DepthRange;
use deepfusion_infer::{Activation, Border, Conv, Depthwise, Graph, Op, ValueId};
use prost::Message;

use crate::model::CANONICAL;
use crate::proto::{GraphProto, ModelProto, NodeProto, TensorProto};
use crate::write::encode;
use crate::{
    DepthModel, Error, FocalLength, FormatVersion, ModelProblem, NodeProblem, OperatorSet,
};

/// Reads the model from an ONNX file that [`write`](crate::write()) wrote.
///
/// Nothing is guessed: the model is written again, and the result must equal the network that was read.
///
/// # Errors
/// [`Error::Decode`] for bytes that are not an ONNX file; [`Error::Node`] naming the first node, or
/// [`Error::Model`] naming the part, that this program would write differently.
pub fn read(bytes: &[u8]) -> Result<DepthModel, Error> {
    let proto = ModelProto::decode(bytes)?;
    let graph = proto
        .graph
        .as_ref()
        .ok_or_else(|| part("graph", ModelProblem::Missing))?;
    let width = side(graph, 2)?;
    let model = DepthModel {
        graph: Reader::new(graph).network(width)?,
        range: DepthRange {
            min_m: number(&proto, "depth_min_m")?,
            max_m: number(&proto, "depth_max_m")?,
        },
        width,
        height: side(graph, 1)?,
        trained_with: focal_length(&proto)?,
        canonical: proto.metadata_props.iter().any(|e| e.key == CANONICAL),
    };
    compare(&proto, graph, &encode(&model)?)?;
    Ok(model)
}

fn part(part: &'static str, reason: ModelProblem) -> Error {
    Error::Model { part, reason }
}

fn number(proto: &ModelProto, key: &'static str) -> Result<f64, Error> {
    let entry = proto.metadata_props.iter().find(|entry| entry.key == key);
    let text = entry.ok_or_else(|| part("metadata", ModelProblem::MissingKey { key }))?;
    text.value.parse().map_err(|_| {
        let value = text.value.clone();
        part("metadata", ModelProblem::NoNumber { key, value })
    })
}

fn focal_length(proto: &ModelProto) -> Result<Option<FocalLength>, Error> {
    let keys = ["training_fx_px", "training_fy_px"];
    if !proto
        .metadata_props
        .iter()
        .any(|entry| keys.contains(&entry.key.as_str()))
    {
        return Ok(None);
    }
    let [fx, fy] = keys;
    Ok(Some(FocalLength {
        fx: number(proto, fx)?,
        fy: number(proto, fy)?,
    }))
}

/// A side of the input image.
fn side(graph: &GraphProto, axis: usize) -> Result<usize, Error> {
    let dims = graph.input.first().and_then(|input| input.dims());
    let side = dims.as_ref().and_then(|dims| dims.get(axis));
    side.and_then(|side| usize::try_from(*side).ok())
        .ok_or_else(|| part("input", ModelProblem::NoSize))
}

/// Checks that the file equals what would be written for the model that was read; the program's version and descriptions may differ.
fn compare(found: &ModelProto, graph: &GraphProto, expected: &ModelProto) -> Result<(), Error> {
    if found.ir_version != expected.ir_version || found.opset_import != expected.opset_import {
        let problem = ModelProblem::Version {
            found: version(found),
            expected: version(expected),
        };
        return Err(part("version", problem));
    }
    let Some(wanted) = &expected.graph else {
        return Err(part("graph", ModelProblem::Missing));
    };
    for (i, node) in graph.node.iter().enumerate() {
        if wanted.node.get(i) != Some(node) {
            return Err(node_error(node, NodeProblem::Differs));
        }
    }
    for (i, tensor) in graph.initializer.iter().enumerate() {
        if wanted.initializer.get(i) != Some(tensor) {
            let name = tensor.name.clone();
            return Err(part("constants", ModelProblem::Constant { name }));
        }
    }
    let types = |values: &[crate::proto::ValueInfoProto]| -> Vec<_> {
        let typed = values.iter().map(|v| (v.name.clone(), v.r#type.clone()));
        typed.collect()
    };
    if types(&graph.input) != types(&wanted.input) {
        return Err(part("input", ModelProblem::NoPicture));
    }
    if types(&graph.output) != types(&wanted.output) {
        return Err(part("outputs", ModelProblem::NoDepth));
    }
    // The expected nodes after the end of the file.
    let counts = |g: &GraphProto| [g.node.len(), g.initializer.len()];
    if counts(graph) != counts(wanted) {
        let problem = ModelProblem::Counts {
            found: counts(graph),
            expected: counts(wanted),
        };
        return Err(part("count of nodes and constants", problem));
    }
    Ok(())
}

fn version(proto: &ModelProto) -> FormatVersion {
    let sets = proto.opset_import.iter().map(|set| OperatorSet {
        domain: set.domain.clone(),
        version: set.version,
    });
    FormatVersion {
        layout: proto.ir_version,
        operators: sets.collect(),
    }
}

fn node_error(node: &NodeProto, reason: NodeProblem) -> Error {
    Error::Node {
        name: node.name.clone(),
        op: node.op_type.clone(),
        reason,
    }
}

/// The operators with which an activation after a convolution begins.
const ACTIVATIONS: [&str; 6] = ["Relu", "Elu", "Neg", "Div", "Tanh", "LeakyRelu"];

struct Reader<'a> {
    nodes: Peekable<Iter<'a, NodeProto>>,
    constants: HashMap<&'a str, &'a TensorProto>,
    /// The graph's value for a name of an array.
    values: HashMap<&'a str, ValueId>,
}

impl<'a> Reader<'a> {
    fn new(graph: &'a GraphProto) -> Self {
        let named = |tensor: &'a TensorProto| (tensor.name.as_str(), tensor);
        Self {
            nodes: graph.node.iter().peekable(),
            constants: graph.initializer.iter().map(named).collect(),
            values: HashMap::new(),
        }
    }

    /// Reads the network, for images of this width.
    fn network(mut self, width: usize) -> Result<Graph, Error> {
        for op in ["Transpose", "Cast", "Div"] {
            self.expect(op)?;
        }
        let mean = self.expect("Sub")?;
        let mean = self.colours(mean)?;
        let std_node = self.expect("Div")?;
        let std = self.colours(std_node)?;
        self.values
            .insert(output(std_node)?.as_str(), ValueId::IMAGE);
        let mut graph = Graph::new(mean, std);
        loop {
            let node = self.next()?;
            let (name, op, last) = match node.op_type.as_str() {
                // The disparity, after the network: a value times a constant.
                "Mul" if self.input(node, 1).is_err() => {
                    graph.add_output(self.input(node, 0)?);
                    return Ok(graph);
                }
                "Mul" if node.name.ends_with(".mask") => self.gate(node)?,
                "Mul" => {
                    let inputs = [self.input(node, 0)?, self.input(node, 1)?];
                    (&node.name, Op::Multiply { inputs }, node)
                }
                "Sub" => self.blend(node)?,
                "Conv" if node.attribute.iter().any(|a| a.name == "group") => {
                    self.depthwise(node)?
                }
                "Conv" | "Pad" => self.conv(node)?,
                "Identity" => self.position(node, width)?,
                "Reshape" if node.name.ends_with(".apart") => self.convex(node, &graph)?,
                "Reshape" => self.cross_covariance(node)?,
                "ReduceMean" if self.next_is("Sub") => self.channel_norm(node)?,
                "MaxPool" => {
                    let input = self.input(node, 0)?;
                    (&node.name, Op::MaxPool { input }, node)
                }
                "Resize" if is_linear(node) => {
                    let input = self.input(node, 0)?;
                    (&node.name, Op::Enlarge { input }, node)
                }
                "Resize" => self.upsample(node)?,
                "DepthToSpace" => self.depth_to_space(node)?,
                "Concat" => {
                    let inputs = (0..node.input.len()).map(|i| self.input(node, i));
                    let inputs = inputs.collect::<Result<_, _>>()?;
                    (&node.name, Op::Concat { inputs }, node)
                }
                "GlobalAveragePool" => {
                    let input = self.input(node, 0)?;
                    (&node.name, Op::GlobalMean { input }, node)
                }
                "ReduceMean" => {
                    let input = self.input(node, 0)?;
                    self.expect("ReduceMax")?;
                    let node = self.expect("Concat")?;
                    (&node.name, Op::ChannelExtent { input }, node)
                }
                "Add" => {
                    let (input, pixel) = (self.input(node, 0)?, self.input(node, 1)?);
                    (&node.name, Op::AddPixel { input, pixel }, node)
                }
                _ => return Err(node_error(node, NodeProblem::NotExpected)),
            };
            let value = graph.push(name, op)?;
            self.values.insert(output(last)?.as_str(), value);
        }
    }

    /// `[Pad →] Conv [→ Add] [→ activation]`: name, operation, last node.
    fn conv(&mut self, first: &'a NodeProto) -> Result<(&'a String, Op, &'a NodeProto), Error> {
        let input = self.input(first, 0)?;
        let (border, node) = if first.op_type == "Pad" {
            let node = self.after(first, &["Conv"]);
            let node = node.ok_or_else(|| node_error(first, NodeProblem::NoConv))?;
            (Border::Reflect, node)
        } else {
            (Border::Zero, first)
        };
        let weight = self.constant(node, 1)?;
        let [channels_out, channels_in, kernel, _] = weight.dims[..] else {
            return Err(node_error(node, NodeProblem::WeightDimensions));
        };
        let size = |n: i64| usize::try_from(n).unwrap_or(0);
        let strides = node.attribute.iter().find(|a| a.name == "strides");
        let stride = strides.and_then(|a| a.ints.first().copied()).unwrap_or(1);
        let dilations = node.attribute.iter().find(|a| a.name == "dilations");
        let dilation = dilations.and_then(|a| a.ints.first().copied());
        let mut last = node;
        // Checked by its name: the next `Add` may also be an operation of its own.
        let residual = match self.after_named(last, "Add", &format!("{}.add", node.name)) {
            Some(add) => {
                last = add;
                Some(self.input(add, 1)?)
            }
            None => None,
        };
        let mut activation = Activation::Identity;
        if let Some(node) = self.after(last, &ACTIVATIONS) {
            last = node;
            activation = match node.op_type.as_str() {
                "Relu" => Activation::Relu,
                "Elu" => Activation::Elu,
                "Tanh" => Activation::Tanh,
                "LeakyRelu" => Activation::LeakyRelu,
                "Div" => {
                    for op in ["Erf", "Add", "Mul", "Mul"] {
                        last = self.expect(op)?;
                    }
                    Activation::Gelu
                }
                _ => {
                    for op in ["Exp", "Add", "Reciprocal"] {
                        last = self.expect(op)?;
                    }
                    Activation::Sigmoid
                }
            };
        }
        let conv = Conv {
            input,
            weight: floats(node, weight)?,
            bias: floats(node, self.constant(node, 2)?)?,
            channels_in: size(channels_in),
            channels_out: size(channels_out),
            kernel: size(kernel),
            stride: size(stride),
            dilation: size(dilation.unwrap_or(1)),
            border,
            residual,
            activation,
        };
        Ok((&node.name, Op::Conv(Box::new(conv)), last))
    }

    fn depthwise(&self, node: &'a NodeProto) -> Result<(&'a String, Op, &'a NodeProto), Error> {
        let weight = self.constant(node, 1)?;
        let [_, _, kernel, _] = weight.dims[..] else {
            return Err(node_error(node, NodeProblem::WeightDimensions));
        };
        let first = |name: &str| {
            let found = node.attribute.iter().find(|a| a.name == name);
            let first = found.and_then(|a| a.ints.first().copied());
            usize::try_from(first.unwrap_or(1)).unwrap_or(0)
        };
        let op = Depthwise {
            input: self.input(node, 0)?,
            weight: floats(node, weight)?,
            bias: floats(node, self.constant(node, 2)?)?,
            kernel: usize::try_from(kernel).unwrap_or(0),
            stride: first("strides"),
            dilation: first("dilations"),
        };
        Ok((&node.name, Op::Depthwise(Box::new(op)), node))
    }

    /// Number of channels and size identify it; that its values are the positions' is checked when it is written again.
    fn position(
        &self,
        node: &'a NodeProto,
        width: usize,
    ) -> Result<(&'a String, Op, &'a NodeProto), Error> {
        let code = self.constant(node, 0)?;
        // The square root of the number of values gives its sides.
        floats(node, code)?;
        let side = |axis: usize| {
            let side = code.dims.get(axis).copied();
            side.and_then(|side| usize::try_from(side).ok())
                .filter(|side| *side > 0)
                .ok_or_else(|| node_error(node, NodeProblem::NoPositions))
        };
        let op = Op::Position {
            per_axis: side(1)? / 2,
            halvings: (width / side(3)?).max(1).ilog2(),
        };
        Ok((&node.name, op, node))
    }

    /// `ReduceMean → Sub → Mul → ReduceMean → Add → Sqrt → Div`: name, operation, last node.
    fn channel_norm(
        &mut self,
        node: &'a NodeProto,
    ) -> Result<(&'a String, Op, &'a NodeProto), Error> {
        let input = self.input(node, 0)?;
        for op in ["Sub", "Mul", "ReduceMean"] {
            self.expect(op)?;
        }
        let add = self.expect("Add")?;
        let epsilon = floats(add, self.constant(add, 1)?)?;
        let epsilon = epsilon.first().copied();
        let epsilon = epsilon.ok_or_else(|| node_error(add, NodeProblem::NoNumber))?;
        self.expect("Sqrt")?;
        let last = self.expect("Div")?;
        Ok((&last.name, Op::ChannelNorm { input, epsilon }, last))
    }

    /// From one `Reshape` to the next: name, operation, last node.
    fn cross_covariance(
        &mut self,
        node: &'a NodeProto,
    ) -> Result<(&'a String, Op, &'a NodeProto), Error> {
        let input = self.input(node, 0)?;
        for op in ["Gather", "Gather", "Gather"] {
            self.expect(op)?;
        }
        for _ in ["queries", "keys"] {
            for op in ["Mul", "ReduceSum", "Add", "Sqrt", "Div"] {
                self.expect(op)?;
            }
        }
        for op in ["Transpose", "MatMul"] {
            self.expect(op)?;
        }
        let factor = self.expect("Mul")?;
        let temperature = floats(factor, self.constant(factor, 1)?)?;
        for op in ["Softmax", "MatMul"] {
            self.expect(op)?;
        }
        let last = self.expect("Reshape")?;
        let op = Op::CrossCovariance { input, temperature };
        Ok((&last.name, op, last))
    }

    /// `Resize [→ Concat]`: name, operation, last node.
    fn upsample(&mut self, node: &'a NodeProto) -> Result<(&'a String, Op, &'a NodeProto), Error> {
        let input = self.input(node, 0)?;
        let joined = node.name.strip_suffix(".resize");
        let concat = joined.and_then(|name| self.after_named(node, "Concat", name));
        let (skip, last) = match concat {
            Some(concat) => (Some(self.input(concat, 1)?), concat),
            None => (None, node),
        };
        Ok((&last.name, Op::UpsampleConcat { input, skip }, last))
    }

    /// `DepthToSpace [→ Slice]`: name, operation, last node.
    fn depth_to_space(
        &mut self,
        node: &'a NodeProto,
    ) -> Result<(&'a String, Op, &'a NodeProto), Error> {
        let input = self.input(node, 0)?;
        let cut = node.name.strip_suffix(".whole");
        let cut = cut.and_then(|name| self.after_named(node, "Slice", name));
        let last = cut.unwrap_or(node);
        Ok((&last.name, Op::DepthToSpace { input }, last))
    }

    /// `Mul [→ Add] → Mul`: name, operation, last node.
    fn gate(&mut self, node: &'a NodeProto) -> Result<(&'a String, Op, &'a NodeProto), Error> {
        let (spatial, channel) = (self.input(node, 0)?, self.input(node, 1)?);
        let pass = self.after(node, &["Add"]);
        let last = self.expect("Mul")?;
        let gate = Op::Gate {
            input: self.input(last, 0)?,
            spatial,
            channel,
            residual: pass.is_some(),
        };
        Ok((&last.name, gate, last))
    }

    /// `Sub → Mul → Add`: name, operation, last node.
    fn blend(&mut self, node: &'a NodeProto) -> Result<(&'a String, Op, &'a NodeProto), Error> {
        let (candidate, state) = (self.input(node, 0)?, self.input(node, 1)?);
        let step = self.expect("Mul")?;
        let share = self.input(step, 0)?;
        let last = self.expect("Add")?;
        let op = Op::Blend {
            state,
            candidate,
            share,
        };
        Ok((&last.name, op, last))
    }

    /// From `Reshape` and `Softmax` of the weights to the last `Reshape`: name, operation, last node.
    fn convex(
        &mut self,
        node: &'a NodeProto,
        graph: &Graph,
    ) -> Result<(&'a String, Op, &'a NodeProto), Error> {
        let weights = self.input(node, 0)?;
        self.expect("Softmax")?;
        let taps = self.expect("Conv")?;
        let input = self.input(taps, 0)?;
        for op in ["Reshape", "Mul", "ReduceSum", "Reshape", "Transpose"] {
            self.expect(op)?;
        }
        let last = self.expect("Reshape")?;
        // Nine for each pixel of a block.
        let block = (graph.shape(weights).channels / 9).max(1);
        let op = Op::ConvexUpsample {
            input,
            weights,
            halvings: block.ilog2() / 2,
        };
        Ok((&last.name, op, last))
    }

    fn next_is(&mut self, op: &str) -> bool {
        self.nodes.peek().is_some_and(|node| node.op_type == op)
    }

    fn next(&mut self) -> Result<&'a NodeProto, Error> {
        self.nodes
            .next()
            .ok_or_else(|| part("nodes", ModelProblem::EndsEarly))
    }

    fn expect(&mut self, op: &'static str) -> Result<&'a NodeProto, Error> {
        let node = self.next()?;
        if node.op_type == op {
            return Ok(node);
        }
        Err(node_error(node, NodeProblem::Expected { op }))
    }

    /// The next node, if it is one of `ops` and takes `before` as its input.
    fn after(&mut self, before: &NodeProto, ops: &[&str]) -> Option<&'a NodeProto> {
        self.nodes.next_if(|node| {
            ops.contains(&node.op_type.as_str())
                && !node.input.is_empty()
                && node.input.first() == before.output.first()
        })
    }

    /// The same, if it also has this name.
    fn after_named(&mut self, before: &NodeProto, op: &str, name: &str) -> Option<&'a NodeProto> {
        let next = self.nodes.peek();
        next.filter(|node| node.name == name)?;
        self.after(before, &[op])
    }

    fn input(&self, node: &NodeProto, index: usize) -> Result<ValueId, Error> {
        let name = node.input.get(index).map_or("", String::as_str);
        let value = self.values.get(name).copied();
        value.ok_or_else(|| {
            let name = name.to_owned();
            node_error(node, NodeProblem::UnknownInput { name })
        })
    }

    fn constant(&self, node: &NodeProto, index: usize) -> Result<&'a TensorProto, Error> {
        let name = node.input.get(index).map_or("", String::as_str);
        let tensor = self.constants.get(name).copied();
        tensor.ok_or_else(|| {
            let name = name.to_owned();
            node_error(node, NodeProblem::MissingConstant { name })
        })
    }

    /// One number each for red, green and blue.
    fn colours(&self, node: &NodeProto) -> Result<[f32; 3], Error> {
        let values = floats(node, self.constant(node, 1)?)?;
        values
            .try_into()
            .map_err(|_| node_error(node, NodeProblem::NoColours))
    }
}

fn floats(node: &NodeProto, tensor: &TensorProto) -> Result<Vec<f32>, Error> {
    tensor.as_floats().ok_or_else(|| {
        let name = tensor.name.clone();
        node_error(node, NodeProblem::Values { name })
    })
}

/// Whether a `Resize` interpolates.
fn is_linear(node: &NodeProto) -> bool {
    let mode = node.attribute.iter().find(|a| a.name == "mode");
    mode.is_some_and(|a| a.s.as_deref() == Some(b"linear".as_slice()))
}

fn output(node: &NodeProto) -> Result<&String, Error> {
    let first = node.output.first();
    first.ok_or_else(|| node_error(node, NodeProblem::NoOutput))
}
