use deepfusion_jobs::packing::{PackOptions, PackedRun, pack_run};
use deepfusion_weights::MAX_BYTES;

use crate::cli::PackArgs;
use crate::failure::Result;
use crate::output;
use crate::progress::say;

/// `deepfusion weights pack`.
pub(crate) fn run(args: &PackArgs) -> Result<()> {
    let options = PackOptions {
        checkpoint: args.checkpoint,
        name: args.name.clone(),
        note: args.note.clone(),
        recipe: args.recipe.clone(),
        licence: args.licence.clone(),
        simulated_only: args.simulated_only,
    };
    let PackedRun {
        shipped,
        not_known_as_simulated,
        stale,
        ..
    } = pack_run(&args.model, options)?;
    if let Some(stale) = stale {
        tracing::warn!("{stale}");
    }
    for path in not_known_as_simulated {
        tracing::warn!(
            "{}: it is unknown whether its images were simulated; the card states so only because of --simulated-only",
            path.display()
        );
    }
    let [card_path, weights_path] = shipped.write(&args.out, args.overwrite)?;
    let card = &shipped.card;
    say(&format!(
        "{:.1} MB, {:.2} M parameters; depth differs by at most {:.2} % from the run's, on a simulated street",
        card.bytes as f64 / 1e6,
        card.parameters as f64 / 1e6,
        100.0 * card.depth_difference,
    ));
    if card.bytes > MAX_BYTES {
        tracing::warn!(
            "{}: too large to embed (at most {} MB), but --model can still read the file",
            weights_path.display(),
            MAX_BYTES / 1_000_000
        );
    }
    if args.json {
        return output::print_json(&card.summary());
    }
    let (card, weights) = (card_path.display(), weights_path.display());
    output::print(&format!("{weights}\n{card}\n"))
}
