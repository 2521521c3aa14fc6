"""Hit a goal a robot arm has never hit, in about ten real trials (Prior Reinforce)."""
