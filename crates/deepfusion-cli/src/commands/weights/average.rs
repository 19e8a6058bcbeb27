use deepfusion_jobs::averaging;

use crate::cli::AverageArgs;
use crate::failure::Result;
use crate::model::warn_of_hidden;
use crate::output;
use crate::progress::say;

/// `deepfusion weights average`.
pub(crate) fn run(args: &AverageArgs) -> Result<()> {
    for model in &args.models {
        warn_of_hidden(model);
    }
    let made = averaging::average(&args.models, args.shares.as_deref(), &args.out)?;
    for network in &made.networks {
        say(&format!(
            "{:.3} of {}",
            network.share,
            network.path.display()
        ));
    }
    if !made.related {
        tracing::warn!(
            "nothing shows that these networks were trained from the same one; the mean of unrelated networks is worthless"
        );
    }
    if made.lost_uncertainty {
        tracing::warn!("not all of them say how sure they are, so the mean does not");
    }
    if args.json {
        return output::print_json(&serde_json::json!({
            "checkpoint": made.checkpoint,
            "networks": made.networks,
            "related": made.related,
        }));
    }
    output::print(&format!("{}\n", made.checkpoint.display()))
}
