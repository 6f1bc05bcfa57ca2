use super::Scene;
use super::error::SceneError;
use super::load::Context;
pub(crate) fn read(_bytes: &[u8], context: &mut Context<'_>) -> Result<Scene, SceneError> {
    Err(SceneError::file(context.file, "not yet"))
}
