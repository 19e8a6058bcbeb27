//! Convolutions with a residual or an activation after them.

use deepfusion_infer::{Activation, Border, Conv, Depthwise};

use super::Writer;
use crate::Error;
use crate::proto::{AttributeProto, TensorProto};

impl Writer {
    pub(super) fn conv(&mut self, name: &str, conv: &Conv) -> Result<String, Error> {
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

    pub(super) fn depthwise(&mut self, name: &str, op: &Depthwise) -> Result<String, Error> {
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

    /// x·½·(1 + erf(x/√2)), as single operations: this operator set has no `Gelu`, and ONNX Runtime fuses them into one.
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

    /// 1 / (1 + e⁻ˣ), as single operations: ONNX Runtime's `Sigmoid` is off by up to 1.4e-7 where it should be 0, which
    /// is 1e-4 of the depth at 90 m. This is equally exact everywhere, for the work of one channel.
    fn sigmoid(&mut self, name: &str, x: &str) -> Result<String, Error> {
        let one = self.shared(TensorProto::floats("one", &[], &[1.0]))?;
        let x = self.emit("Neg", &format!("{name}.negative"), &[x], vec![])?;
        let x = self.emit("Exp", &format!("{name}.exp"), &[&x], vec![])?;
        let x = self.emit("Add", &format!("{name}.plus_one"), &[&x, &one], vec![])?;
        self.emit("Reciprocal", &format!("{name}.sigmoid"), &[&x], vec![])
    }
}
