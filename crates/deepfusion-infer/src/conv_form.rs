//! What every form of a convolution can do.

use crate::Conv;
use crate::conv::{Geometry, Runs};
use crate::view::Shared;

/// A convolution ready to run on values stored as `E`.
pub(crate) trait ConvForm<E> {
    fn new(conv: &Conv, geometry: Geometry, channel_of: &[Option<usize>]) -> Self;

    /// Elements that it may read behind a buffer's last pixel, whose pixels are `pitch` elements apart.
    fn overread(pitch: usize) -> usize;

    /// What profiles call it.
    fn name(&self) -> &'static str;

    fn geometry(&self) -> &Geometry;

    /// Its runs, if it also reads elements that belong to none of its inputs (`None` as a source). A form's results
    /// depend on nothing but its inputs and the elements listed here.
    fn reads_on(&self) -> Option<(&Geometry, &Runs)>;

    /// # Safety
    /// `arena` must hold every view of the geometry, its border and `overread` behind its buffer included; nobody else
    /// may use the output meanwhile, or write the others.
    unsafe fn run(&self, arena: Shared<E>);
}
