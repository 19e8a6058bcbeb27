//! Pictures of depth, errors and clouds, and the HTML report. Plain slices and `image` pictures, no tensors.
//!
//! Depth is shown on a logarithmic scale, warm near and cold far, with a legend in metres ([`DepthScale`]);
//! disparity without a unit in magma, bright near. Text is drawn in a bitmap font ([`draw_text`]).

mod captioned;
mod charts;
mod cloud_view;
mod colour;
mod depth_panel;
mod depth_picture;
mod error;
mod error_picture;
mod feature_picture;
mod flow_picture;
mod html;
mod learning;
mod panel;
mod shrink;
mod targets;
mod text;
mod top_view;

pub use captioned::{Tile, model_sheet, sheet};
pub use charts::{BarChart, LineChart, ScatterChart, Series, Svg, histogram};
pub use cloud_view::{CloudView, render_cloud};
pub use colour::{ColourMap, DepthScale};
pub use depth_panel::{DepthPanel, depth_panel};
pub use depth_picture::{
    depth_legend, depth_picture, disparity_picture, side_by_side, with_depth_legend,
};
pub use error::{Error, LogProblem, Result};
pub use error_picture::{error_picture, sparse_depth_picture};
pub use feature_picture::{feature_picture, feature_range};
pub use flow_picture::flow_picture;
pub use html::{Cell, HtmlReport, Mark, PictureFormat, ReliabilityBin, ShownFrame};
pub use learning::LearningLog;
pub use panel::{SamplePanel, sample_panel};
pub use shrink::{shrink_depth, shrink_picture};
pub use targets::{birds_eye, box_overlay, colour_of, target_segments};
pub use text::{TextSize, draw_text, text_width};
pub use top_view::TopView;
