/// A map over the image, as coarse as the layer it comes from.
#[derive(Debug, Clone, PartialEq)]
pub struct FeatureMap {
    /// Width, in pixels.
    pub width: usize,
    /// Height, in pixels.
    pub height: usize,
    /// H×W, row by row.
    pub values: Vec<f32>,
}

/// Feature and attention maps of one layer of a network's encoder.
#[derive(Debug, Clone, PartialEq)]
pub struct LayerMaps {
    /// Mean magnitude of the encoder's feature over its channels.
    pub feature: FeatureMap,
    /// The same for what the decoder reads, if context or attention change it.
    pub refined: Option<FeatureMap>,
    /// The spatial mask and the least and greatest value of the channel mask, where there is attention.
    pub attention: Option<(FeatureMap, [f32; 2])>,
}
