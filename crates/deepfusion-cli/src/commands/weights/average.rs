use deepfusion_jobs::averaging;

use crate::cli::AverageArgs;
use crate::failure::Result;
use crate::output;
use crate::progress::say;

/// `deepfusion weights average`.
pub(crate) fn run(args: &AverageArgs) -> Result<()> {
    let made = averaging::average(&args.models, args.shares.as_deref(), &args.out)?;
    if !made.related {
        tracing::warn!(
            "nothing says that these networks began from the same one; the mean of others is worth nothing: measure it before it is used"
        );
    }
    say("measure it beside the runs that it is made of: deepfusion eval, then deepfusion compare");
    output::print(&format!("{}\n", made.checkpoint.display()))
}
