"""The network: backbone, task blocks, files and calibration."""
