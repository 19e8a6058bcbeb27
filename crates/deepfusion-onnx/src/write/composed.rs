//! Operations of ours that consist of several ONNX operations.

use deepfusion_infer::ValueId;

use super::{Writer, along_channels};
use crate::Error;
use crate::proto::{AttributeProto, TensorProto};

impl Writer {
    /// The factors of a Resize that doubles width and height.
    pub(super) fn doubling(&mut self) -> Result<String, Error> {
        let scales = TensorProto::floats("resize.scales", &[4], &[1.0, 1.0, 2.0, 2.0]);
        self.shared(scales)
    }

    pub(super) fn upsample(
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

    /// Enlarges, then crops if the larger size is an odd number of pixels.
    pub(super) fn depth_to_space(&mut self, name: &str, input: ValueId) -> Result<String, Error> {
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

    /// The nine neighbours of each pixel, found by a convolution that picks one each, times the softmax of their weights.
    pub(super) fn convex(
        &mut self,
        name: &str,
        input: ValueId,
        weights: ValueId,
    ) -> Result<String, Error> {
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

    /// Written as single operations: `LayerNormalization` supports only the last axes.
    pub(super) fn channel_norm(
        &mut self,
        name: &str,
        input: ValueId,
        epsilon: f32,
    ) -> Result<String, Error> {
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

    pub(super) fn cross_covariance(
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

    /// Scales rows to length 1.
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
}
