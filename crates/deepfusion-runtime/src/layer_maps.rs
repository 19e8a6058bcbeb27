/// A map over the image, as coarse as the layer it comes from.
#[derive(Debug, Clone, PartialEq)]
pub struct FeatureMap {
    /// Pixels of a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// H×W, row by row.
    pub values: Vec<f32>,
}

/// Where a network looks in an image, from one layer of its encoder.
#[derive(Debug, Clone, PartialEq)]
pub struct LayerMaps {
    /// Mean magnitude of the encoder's feature over its channels.
    pub feature: FeatureMap,
    /// The same of what the decoder reads, where context or attention make it another one.
    pub refined: Option<FeatureMap>,
    /// The spatial mask and the least and greatest value of the channel mask, where there is attention.
    pub attention: Option<(FeatureMap, [f32; 2])>,
}
