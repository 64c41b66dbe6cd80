/* The second plant: wheels' soil forces, wheel speed control and a hitch force around a MuJoCo model. See docs/simulation.md.
 *
 * MuJoCo computes the motion of body and wheels; this file gives it the forces. A wheel stands on soil through tables made by
 * terramechanics.py: stresses under a rigid wheel, by sinkage, slip and how far it has dug itself in. SI units.
 */
#ifndef TERRAGRIP_SECOND_PLANT_H
#define TERRAGRIP_SECOND_PLANT_H
#include <stdint.h>

/* cdef begin */
#define SP_WHEELS 8
#define SP_SOILS 4
#define SP_VALUES 5 /* per unit of stiffness and strength: normal force of pressure and of shear, moment over radius, thrust, resistance */
#define SP_SCALARS 22
#define SP_PER_WHEEL 9

typedef struct {
    int32_t sinkages, slips, depths; /* nodes: sqrt(sinkage), slip -1..1, dug-in slip 0..1 */
    double deepest[8];               /* by wheel: m, of the last sinkage node */
    const double *table[8];          /* by wheel: [sinkage][slip][depth][SP_VALUES] */
    double lateral;                  /* largest lateral force over the normal force */
    double digging_length;           /* m of the rim's travel over which digging in follows slip */
} sp_soil;

typedef struct { /* a sum of cosines: amplitude, wave vector, phase */
    int32_t count;
    const double *amplitude, *wave_x, *wave_y, *phase;
} sp_field;

typedef struct {
    int32_t wheels, base_dofs, chassis_body; /* base_dofs: joints of the body come first, the wheels' hinges after them */
    int32_t wheel_body[8];
    double radius[8], inertia[8], side[8], ahead[8]; /* side: m to the left; ahead: m ahead of the rear axle */
    int32_t driven[8], steered[8];
    double tire_resistance, rest_speed;       /* rolling resistance reaches full size at this rim speed, m/s */
    double relaxation[8], shear_damping[8], normal_damping[8]; /* m, N s/m, N s/m */
    double lateral_length;                    /* m, over which lateral force builds up */
    double wheelbase, mass;
    double speed_gain, speed_integral, motor_lag, antiwindup_time, torque_limit, power_limit;
    double hitch[3];                          /* m, in the body's frame from its centre of mass */
    double draught_speed, draught_lag, draught_floor; /* growth a m/s; s; m/s at which draught is full */
    int32_t draughts;
    const double *draught_at, *draught;       /* m of travel, N */
    int32_t commands;
    const double *command_time, *command, *curvature; /* s; m/s of the rim (NaN: motors off until the next point); 1/m */
    int32_t soils, mixes;                     /* soils along the travel: mixture between the points */
    sp_soil soil[4];
    const double *mix_at, *mix;               /* m; [mixes][soils] shares */
    sp_field roughness, hills, stiffness, strength; /* m; m; relative; relative */
} sp_machine;

typedef struct { /* what a drive carries from step to step beside the model's own state */
    double torque[SP_WHEELS], sum[SP_WHEELS], slip[SP_WHEELS], dug[SP_WHEELS], aside[SP_WHEELS], pushed[SP_WHEELS];
    double pull, travel, steer;
    int32_t at_command, at_draught, at_mix, step;
} sp_memory;

/* Run `steps` steps of the model; every `stride` of them a row of SP_SCALARS + wheels * SP_PER_WHEEL values. Returns rows
 * written; negative: the state left the finite numbers after that many rows (less one). Scalars: time, x, y, forward speed, its
 * rate, hitch force, specific force (3, body), rates (3, body), pitch (nose up), roll, heading, travel, share of the last soil,
 * sum of normal forces, sum of resistances, forward part of normal forces, motors off, lateral speed. Per wheel: speed, motor
 * torque, tangential over normal force, normal force, resistance, hub speed, sinkage, slip felt, dug-in slip. */
int32_t sp_run(void *model, void *data, const sp_machine *machine, double settle, int32_t steps, int32_t stride, double *trace);
/* The same drive in pieces, so that a controller can set command and limits between them: settle it, then steps as often as
 * wanted. Both return as sp_run does. */
int32_t sp_begin(void *model, void *data, const sp_machine *machine, double settle, sp_memory *memory);
int32_t sp_continue(void *model, void *data, const sp_machine *machine, sp_memory *memory, int32_t steps, int32_t stride, double *trace);
/* Height and gradient (3 values) of the ground at a place: for tests. */
void sp_ground(const sp_machine *machine, double x, double y, double *height_and_gradient);
/* cdef end */
#endif
