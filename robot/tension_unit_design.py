"""The table ``[tension_unit]``: four motors with gear, pulley and torque cell, paper 3 section II.

The paper names the parts (DCX16L with a 62:1 gearhead, TQ201-100Z torque cell, pulleys of 20 mm);
of the motor's and gear's numbers only what it prints is known, the others are assumptions.
"""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from robot.section import NotNegative, Positive, Section


class TensionUnit(Section):
    """One module; all four are alike but for their cells' offset and gain, which a seed draws."""

    pulley_radius_mm: Annotated[float, Field(gt=0, le=100)]
    gear_ratio: Annotated[float, Field(ge=1, le=1000)]
    gear_efficiency: Annotated[float, Field(ge=0.1, le=1)]
    gear_stiffness_nm_rad: Annotated[float, Field(gt=0, le=200)]
    backlash_deg: Annotated[float, Field(ge=0, le=10)]
    rotor_inertia_g_cm2: Annotated[float, Field(ge=0.05, le=100)]
    pulley_inertia_g_cm2: Annotated[float, Field(ge=5, le=10000)]
    torque_constant_mnm_a: Positive
    current_limit_a: Positive
    motor_friction_mnm: NotNegative
    motor_viscosity_nnm_s: NotNegative
    encoder_counts: Annotated[int, Field(ge=16, le=1000000)]
    current_noise_ma: NotNegative
    cell_full_scale_nm: Positive
    cell_noise_mnm: NotNegative
    cell_resolution_mnm: NotNegative
    cell_flat_ms: NotNegative
    cell_offset_mnm: NotNegative
    cell_gain_percent: NotNegative
    position_bandwidth_hz: Annotated[float, Field(gt=0, le=60)]

    @property
    def cell_flat_s(self) -> float:
        """After which time without any change a cell is flat, s; 0 where that cannot be told,
        because its noise is no larger than its resolution.
        """
        tells = self.cell_noise_mnm > self.cell_resolution_mnm
        return self.cell_flat_ms * 1e-3 if tells else 0.0
