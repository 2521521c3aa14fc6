"""P: ways of seeing a trial's error. One file each; all share the interface of `base`."""
