"""A task's folder on disk: manifest, demonstrations, model, trial journal."""
