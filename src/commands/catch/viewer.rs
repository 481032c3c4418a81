//! `--view` of commands that catch: where the Rerun viewer is.

use std::path::Path;

use clap::Args;

#[derive(Args)]
pub struct ViewerArgs {
    /// Show what the page draws in the Rerun viewer, or write it for one, or show it in one that runs already
    #[arg(long, value_name = "FILE.rrd|URL", num_args = 0..=1)]
    view: Option<Option<String>>,
}

impl ViewerArgs {
    /// Refuses what could not be shown, before anything is computed in vain.
    pub fn check(&self) -> anyhow::Result<()> {
        #[cfg(not(feature = "rerun"))]
        if self.view.is_some() {
            anyhow::bail!(tactnet_models::left_out("rerun"));
        }
        if let Some(Some(file)) = &self.view
            && Path::new(file).exists()
        {
            anyhow::bail!("{file}: there is such a file already");
        }
        Ok(())
    }

    /// Returns where to show it, if it is to be shown.
    #[cfg(feature = "rerun")]
    pub fn target(&self) -> Option<tactnet_recording::view::Target> {
        use tactnet_recording::view::Target;
        let target = self.view.as_ref()?;
        Some(match target.as_deref() {
            None => Target::Viewer {
                memory_limit: "2GB".into(),
            },
            Some(url) if url.contains("://") => Target::Connect { url: url.into() },
            Some(path) => Target::File { path: path.into() },
        })
    }
}
