use deepfusion_jobs::importing::{KNOWN, KnownWeights};
use deepfusion_weights::{Card, CardSummary};

use crate::failure::Result;
use crate::output;

/// A run, from which training starts without an import, as an entry of the same list.
const RUN: KnownWeights = KnownWeights {
    name: "a run of this program",
    files: "its folder, last.safetensors or best.safetensors",
    gives: "with --init: training starts from its networks",
    terms: "yours",
};

/// What is listed, for scripts.
#[derive(serde::Serialize)]
struct Listing<'a> {
    embedded: Vec<CardSummary<'a>>,
    importable: Vec<&'a KnownWeights>,
}

/// `deepfusion weights list`.
pub(crate) fn run(json: bool) -> Result<()> {
    let networks = deepfusion_weights::all()?;
    if json {
        return output::print_json(&Listing {
            embedded: networks.iter().map(|n| n.card.summary()).collect(),
            importable: KNOWN.iter().chain([&RUN]).collect(),
        });
    }
    let mut text = "Embedded, for --model NAME and --init NAME:\n".to_owned();
    if networks.is_empty() {
        text += "  none in this build; `weights pack` makes one of a run\n";
    }
    for network in &networks {
        text += &network_text(&network.card);
    }
    text += "\nImportable, with `weights import`:\n";
    for known in KNOWN.iter().chain([&RUN]) {
        let KnownWeights {
            name,
            files,
            gives,
            terms,
        } = known;
        text += &format!("  {name}\n    files  {files}\n    gives  {gives}\n    terms  {terms}\n");
    }
    output::print(&text)
}

/// The lines about one network.
fn network_text(card: &Card) -> String {
    let default = if card.is_default() {
        " (used if no --model is given)"
    } else {
        ""
    };
    let mut text = format!("  {}{default}\n", card.name);
    for (key, value) in card.rows() {
        text += &format!("    {key:<9} {value}\n");
    }
    text
}
