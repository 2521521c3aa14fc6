"""M: condition adapters. One file each; all share the interface of `base`."""
