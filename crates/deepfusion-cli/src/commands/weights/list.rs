use deepfusion_hint::count_of;
use deepfusion_jobs::importing::{KNOWN, KnownWeights};
use deepfusion_weights::{Card, DEFAULT, Figure};
use serde::Serialize;

use crate::failure::Result;
use crate::output;

/// What training starts from without an import, in the same list.
const RUN: KnownWeights = KnownWeights {
    name: "a run of this program",
    files: "its folder, last.safetensors or best.safetensors",
    gives: "with --init: training starts from its networks",
    terms: "yours",
};

/// What `--json` prints of a packed network: its card without the configuration, and what of that one asks for first.
#[derive(Debug, Serialize)]
pub(crate) struct WeightsRow<'a> {
    name: &'a str,
    /// Whether it is meant where no `--model` is given.
    default: bool,
    preset: &'a str,
    size: Option<[i64; 2]>,
    parameters: u64,
    bytes: u64,
    numbers: &'a str,
    depth_difference: f64,
    checkpoint: &'a str,
    steps: usize,
    date: &'a str,
    data: &'a [String],
    simulated_only: bool,
    recipe: Option<&'a str>,
    licence: &'a str,
    note: Option<&'a str>,
    figures: &'a [Figure],
    sha256: &'a str,
    format_version: u32,
}

impl<'a> From<&'a Card> for WeightsRow<'a> {
    fn from(card: &'a Card) -> Self {
        Self {
            name: &card.name,
            default: card.name == DEFAULT,
            preset: card.preset(),
            size: card.size(),
            parameters: card.parameters,
            bytes: card.bytes,
            numbers: &card.numbers,
            depth_difference: card.depth_difference,
            checkpoint: &card.checkpoint,
            steps: card.steps,
            date: &card.date,
            data: &card.data,
            simulated_only: card.simulated_only,
            recipe: card.recipe.as_deref(),
            licence: &card.licence,
            note: card.note.as_deref(),
            figures: &card.figures,
            sha256: &card.sha256,
            format_version: card.format_version,
        }
    }
}

/// `deepfusion weights list`.
pub(crate) fn run(json: bool) -> Result<()> {
    let networks = deepfusion_weights::all()?;
    if json {
        let embedded: Vec<WeightsRow> =
            networks.iter().map(|n| WeightsRow::from(&n.card)).collect();
        let importable: Vec<_> = KNOWN
            .iter()
            .chain([&RUN])
            .map(|known| {
                let KnownWeights {
                    name,
                    files,
                    gives,
                    terms,
                } = known;
                serde_json::json!({"name": name, "files": files, "gives": gives, "terms": terms})
            })
            .collect();
        return output::print_json(
            &serde_json::json!({"embedded": embedded, "importable": importable}),
        );
    }
    let mut text = "Embedded, for --model NAME and --init NAME:\n".to_owned();
    if networks.is_empty() {
        text += "  none in this build; `weights pack` makes one of a run\n";
    }
    for network in &networks {
        text += &network_text(&network.card);
    }
    text += "\nTo be imported, with `weights import`:\n";
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

/// A network in lines.
fn network_text(card: &Card) -> String {
    /// Recordings that are named.
    const NAMED: usize = 6;
    let size = card
        .size()
        .map_or(String::new(), |[w, h]| format!(" at {w}x{h}"));
    let default = if card.name == DEFAULT {
        " (taken where no --model is given)"
    } else {
        ""
    };
    let mut data = card.data.iter().take(NAMED).cloned().collect::<Vec<_>>();
    if card.data.len() > NAMED {
        data.push(format!("and {} more", card.data.len() - NAMED));
    }
    let real = if card.simulated_only {
        ", no real image among them"
    } else {
        ""
    };
    let mut text = format!(
        "  {}{default}\n    network   {}{size}, {:.2} M parameters, {:.1} MB ({})\n    last run  {}, the {} checkpoint, {}\n    \
         from      {}{real}\n",
        card.name,
        card.preset(),
        card.parameters as f64 / 1e6,
        card.bytes as f64 / 1e6,
        card.numbers,
        count_of(card.steps, "step"),
        card.checkpoint,
        card.date,
        data.join(", "),
    );
    let rest = [
        ("recipe", card.recipe.as_deref()),
        ("note", card.note.as_deref()),
        ("licence", Some(card.licence.as_str())),
        ("sha256", Some(card.sha256.as_str())),
    ];
    for figure in &card.figures {
        text += &format!("    measured  {}\n", figure_text(figure));
    }
    for (key, value) in rest {
        if let Some(value) = value {
            text += &format!("    {key:<9} {value}\n");
        }
    }
    text
}

fn figure_text(figure: &Figure) -> String {
    let seen = match figure.held_out {
        Some(true) => "not seen in training",
        Some(false) => "seen in training",
        None => "not known whether seen in training",
    };
    format!(
        "{}: abs_rel {:.3}, scaled {:.3}, scale {:.3}, within 25 % {:.1} % ({}, {seen})",
        figure.data,
        figure.abs_rel,
        figure.abs_rel_scaled,
        figure.scale,
        100.0 * figure.a1,
        count_of(figure.images, "image"),
    )
}
