# RV32IMAFC: single-precision FPU.
FAMILY_rv32imafc     := rv32
MACHINE_rv32imafc    := -march=rv32imafc -mabi=ilp32f -mcmodel=medany
