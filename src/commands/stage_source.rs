//! Robot and balls for the live page.

use tactnet_catching_roles::{RoleError, StageView};
use tactnet_channel::Bus;
use tactnet_serving::web::StageSource;

/// Follows the channels of a catching stack for a page.
///
/// # Errors
/// No hub; channels missing in the table.
pub fn stage_source(bus: &Bus) -> Result<StageSource, RoleError> {
    let mut view = StageView::open(bus)?;
    Ok(Box::new(move || {
        let stage = view.look()?;
        Ok(serde_json::to_value(stage).unwrap_or_default())
    }))
}
