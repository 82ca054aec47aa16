"""The transports that hilrig's bus is compared with: scripts that run in separate processes and are never imported."""
