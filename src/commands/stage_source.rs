//! State of the catching stage for the live page.

use tactnet_catching_roles::{RoleError, StageView};
use tactnet_channel::Bus;
use tactnet_serving::web::StageSource;

/// Subscribes to the channels of a catching stack.
///
/// # Errors
/// Fails without a hub, or if channels are missing in the table.
pub fn stage_source(bus: &Bus) -> Result<StageSource, RoleError> {
    let mut view = StageView::open(bus)?;
    Ok(Box::new(move || {
        let stage = view.look()?;
        Ok(serde_json::to_value(stage).unwrap_or_default())
    }))
}
