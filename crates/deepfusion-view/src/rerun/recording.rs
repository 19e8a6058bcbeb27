//! Writes the viewer's messages in order.

use std::collections::HashSet;
use std::io::Write;

use re_build_info::CrateVersion;
use re_chunk::{Chunk, EntityPath, RowId};
use re_log_encoding::{Encoder, EncodingOptions};
use re_log_types::{LogMsg, SetStoreInfo, StoreId, StoreInfo, StoreKind, StoreSource, TimePoint};
use re_sdk_types::AsComponents;
use re_sdk_types::archetypes::{Clear, RecordingInfo, ViewCoordinates};

use crate::EncodingProblem;

/// The application's name in recordings: the viewer keeps one layout of its windows for each application.
const APPLICATION: &str = "deepfusion";

/// A recording that is being written.
pub(super) struct Recording<W: Write> {
    encoder: Encoder<W>,
    store: StoreId,
    /// Entities with content that must be cleared when it disappears.
    shown: HashSet<&'static str>,
}

impl<W: Write> Recording<W> {
    /// Starts a recording with the static content. `name` is shown to users.
    pub(super) fn begin(out: W, name: &str) -> Result<Self, EncodingProblem> {
        // A new id each time, so that two files of one folder stay separate recordings.
        let store = StoreId::random(StoreKind::Recording, APPLICATION);
        let made_by = format!("deepfusion {}", env!("CARGO_PKG_VERSION"));
        let info = StoreInfo::new(store.clone(), StoreSource::Other(made_by));
        let mut recording = Self {
            encoder: Encoder::new_eager(
                CrateVersion::LOCAL,
                EncodingOptions::PROTOBUF_COMPRESSED,
                out,
            )?,
            store,
            shown: HashSet::new(),
        };
        recording
            .encoder
            .append(&LogMsg::SetStoreInfo(SetStoreInfo {
                row_id: *RowId::new(),
                info,
            }))?;
        let always = TimePoint::STATIC;
        let info = RecordingInfo::new().with_name(name);
        recording.append(EntityPath::properties(), &always, &info)?;
        recording.append("world".into(), &always, &ViewCoordinates::RDF())?;
        Ok(recording)
    }

    /// Logs an entity's content from this time on.
    pub(super) fn log(
        &mut self,
        entity: &'static str,
        time: &TimePoint,
        what: &dyn AsComponents,
    ) -> Result<(), EncodingProblem> {
        self.shown.insert(entity);
        self.append(entity.into(), time, what)
    }

    /// Logs an entity's content, or clears it: the viewer keeps showing the last logged content.
    pub(super) fn log_or_clear(
        &mut self,
        entity: &'static str,
        time: &TimePoint,
        what: Option<&dyn AsComponents>,
    ) -> Result<(), EncodingProblem> {
        match what {
            Some(what) => self.log(entity, time, what),
            None if self.shown.remove(entity) => self.append(entity.into(), time, &Clear::flat()),
            None => Ok(()),
        }
    }

    /// Writes the end.
    pub(super) fn finish(mut self) -> Result<(), EncodingProblem> {
        Ok(self.encoder.finish()?)
    }

    fn append(
        &mut self,
        entity: EntityPath,
        time: &TimePoint,
        what: &dyn AsComponents,
    ) -> Result<(), EncodingProblem> {
        let chunk = Chunk::builder(entity)
            .with_archetype(RowId::new(), time.clone(), what)
            .build()?;
        let message = LogMsg::ArrowMsg(self.store.clone(), chunk.to_arrow_msg()?);
        self.encoder.append(&message)?;
        Ok(())
    }
}
