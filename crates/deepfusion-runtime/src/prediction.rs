use deepfusion_geometry::{DepthMap, Intrinsics};

use crate::resample::Resample;

/// The metric depth of an image.
#[derive(Debug, Clone, PartialEq)]
pub struct Prediction {
    /// Metric disparity in 1/m at the network's size (the largest of several), row by row; focal correction applied.
    pub disparity: Vec<f32>,
    /// ln b at the network's size, with b the Laplace scale of the error of ln depth; `None` if the network does not predict it.
    pub log_scale: Option<Vec<f32>>,
    /// Width of `disparity`.
    pub width: usize,
    /// Height of `disparity`.
    pub height: usize,
    /// The part of the image that the network saw: x, y, width, height.
    pub window: [u32; 4],
    /// Size of the whole image.
    pub image_size: [u32; 2],
    /// Factor applied to depth because the focal length differs from that in training; of several predictions, the factor of the largest.
    pub focal_factor: f64,
}

impl Prediction {
    /// Multiplies depth by `factor`.
    pub fn scale_depth(&mut self, factor: f64) {
        let disparity_factor = (1.0 / factor) as f32;
        for disparity in &mut self.disparity {
            *disparity *= disparity_factor;
        }
    }

    /// Depth at the network's size, and the camera at that size; `camera` is that of the whole image.
    #[must_use]
    pub fn network_depth(&self, camera: &Intrinsics) -> (DepthMap, Intrinsics) {
        let [x, y, w, h] = self.window;
        let depth = DepthMap {
            width: self.width,
            height: self.height,
            data: self.disparity.iter().map(|d| 1.0 / d).collect(),
        };
        let k = camera.cropped(x, y, w, h);
        (depth, k.resized(self.width as u32, self.height as u32))
    }

    /// Depth at the image's own size: disparity is enlarged (bilinear, half-pixel centres), then
    /// inverted; 0 outside the window that the network saw.
    #[must_use]
    pub fn depth(&self) -> DepthMap {
        let mut depth = DepthMap::empty(0, 0);
        self.depth_into(&mut depth);
        depth
    }

    /// Like [`Self::depth`], but written into `depth`, which is resized.
    pub fn depth_into(&self, depth: &mut DepthMap) {
        self.enlarge(&self.disparity, |disparity| 1.0 / disparity, depth);
    }

    /// Standard deviation of depth in metres at the image's own size, √2·b·depth, 0 outside the window; `None` if the
    /// network does not predict it. It is the network's own estimate, not calibrated.
    #[must_use]
    pub fn sigma(&self) -> Option<DepthMap> {
        self.sigma_of(&self.depth())
    }

    /// Like [`Self::sigma`], but from the result of [`Self::depth`].
    #[must_use]
    pub fn sigma_of(&self, depth: &DepthMap) -> Option<DepthMap> {
        let relative = |log_scale: f32| std::f32::consts::SQRT_2 * log_scale.exp();
        let mut sigma = DepthMap::empty(0, 0);
        self.enlarge(self.log_scale.as_ref()?, relative, &mut sigma);
        for (relative, depth) in sigma.data.iter_mut().zip(&depth.data) {
            *relative *= depth;
        }
        Some(sigma)
    }

    /// How far each pixel's depth can be trusted, at the image's own size ([`Self::confidence_of`]); `None` if the network does not
    /// predict its uncertainty. It is the network's own estimate, not calibrated.
    #[must_use]
    pub fn confidence(&self) -> Option<DepthMap> {
        let depth = self.depth();
        let sigma = self.sigma_of(&depth)?;
        Some(Self::confidence_of(&depth, &sigma))
    }

    /// How far each pixel of a depth can be trusted, 0 to 1, from its standard deviation `sigma`: exp(−b), where b = sigma/(√2·depth) is
    /// the expected error of ln depth (the Laplace scale). 0.9 means that the depth is expected to be 10 % off; 0 means that there is no
    /// depth.
    #[must_use]
    pub fn confidence_of(depth: &DepthMap, sigma: &DepthMap) -> DepthMap {
        let of = |(sigma, depth): (&f32, &f32)| {
            if *depth > 0.0 {
                (-sigma / (std::f32::consts::SQRT_2 * depth)).exp()
            } else {
                0.0
            }
        };
        DepthMap {
            width: depth.width,
            height: depth.height,
            data: sigma.data.iter().zip(&depth.data).map(of).collect(),
        }
    }

    /// Values at the image's own size, bilinear, with `of` applied to each; 0 outside the window.
    fn enlarge(&self, values: &[f32], of: impl Fn(f32) -> f32, map: &mut DepthMap) {
        let [x0, y0, w, h] = self.window.map(|v| v as usize);
        let [width, height] = self.image_size.map(|v| v as usize);
        (map.width, map.height) = (width, height);
        map.data.clear();
        map.data.resize(width * height, 0.0);
        let resample = Resample::new((self.width, self.height), (w, h));
        for y in 0..h {
            let row = &mut map.data[(y0 + y) * width + x0..][..w];
            resample.row(values, y, &of, row);
        }
    }
}
