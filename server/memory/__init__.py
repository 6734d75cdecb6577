"""What processes share: mapped files, and the link between web and control over them."""
