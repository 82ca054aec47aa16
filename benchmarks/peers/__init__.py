"""What hilrig's bus is compared with: scripts that run in processes of their own and are never imported."""
