"""pi: conditional motion generators. One file each; all share the interface of `base`."""
