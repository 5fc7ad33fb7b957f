# RV32IMAC: no FPU.
FAMILY_rv32imac      := rv32
MACHINE_rv32imac     := -march=rv32imac -mabi=ilp32 -mcmodel=medany
