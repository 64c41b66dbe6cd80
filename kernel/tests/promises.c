/* What the head of terragrip.h promises of every function: after a refused call the object and the outputs are as they were, byte for
 * byte; and places of absent wheels are NaN in a tg_estimate, 0 in a tg_step. */
#include "check.h"

enum { GUARD = 0xa5 };

static tg_filter f, f_before;
static tg_consider c, c_before;
static tg_track track, track_before;
static tg_step step, step_before;
static int refused;

static void remember(void)
{
    memset(&step, GUARD, sizeof step);
    memcpy(&f_before, &f, sizeof f);
    memcpy(&c_before, &c, sizeof c);
    memcpy(&track_before, &track, sizeof track);
    memcpy(&step_before, &step, sizeof step);
}

#define REFUSED(call)                                                                              \
    do {                                                                                           \
        remember();                                                                                \
        const tg_status status = (call);                                                           \
        CHECK(status != TG_OK, "%d wheels, policy %d", (int)f.wheels, (int)f.tuning.policy);       \
        CHECK(memcmp(&f, &f_before, sizeof f) == 0, "the filter was changed, status %d", (int)status); \
        CHECK(memcmp(&c, &c_before, sizeof c) == 0, "the columns were changed");                   \
        CHECK(memcmp(&track, &track_before, sizeof track) == 0, "the track was changed");          \
        CHECK(memcmp(&step, &step_before, sizeof step) == 0, "the output was written");            \
        refused++;                                                                                 \
    } while (0)

static int untouched(const void *bytes, size_t size)
{
    for (size_t k = 0; k < size; k++)
        if (((const unsigned char *)bytes)[k] != GUARD) return 0;
    return 1;
}

static void filter_floor(int n, int engine, int policy)
{
    const tg_real bad[] = {(tg_real)NAN, (tg_real)INFINITY, -(tg_real)INFINITY}, huge = sizeof(tg_real) == 8 ? (tg_real)1e307 : (tg_real)1e38f;
    const tg_machine m = random_machine(n);
    const int states = 2 * n + 2;
    tg_tuning t = tg_default_tuning(), other;
    tg_real x[NX] = {0}, P[NX * NX], y[NY], r[NY], q[NX] = {0}, U[NX * NX], D[NX];
    tg_deviations deviations;
    tg_input u = random_input(&m), now;
    t.engine = engine;
    t.policy = policy;
    for (int e = 0; e < states; e++) t.walk[e] = (tg_real)0.01;
    random_covariance(states, 1, P);
    CHECK(tg_filter_init(&f, &m, &t, x, P) == TG_OK, "init");
    CHECK(tg_consider_init(&c, &f, 2) == TG_OK && tg_track_init(&track, &f) == TG_OK, "init");
    memset(&deviations, 0, sizeof deviations);
    for (int k = 0; k < n + 2; k++) y[k] = (tg_real)uniform(0, 1), r[k] = (tg_real)0.01;
    for (int k = 0; k < 8; k++) CHECK(tg_filter_step(&f, (tg_real)0.01, &u, &u, q, y, r, &step) == TG_OK, "step");
    for (int k = n + 2; k < TG_MAX_CHANNELS; k++)
        CHECK(step.innovation[k] == 0 && step.innovation_variance[k] == 0 && step.weight[k] == 0, "channel %d is none", k);
    for (int e = states; e < NX; e++) CHECK(step.adaptation[e] == 0, "state %d is none", e);

    REFUSED(tg_filter_init(&f, NULL, &t, x, P));
    REFUSED(tg_filter_step(&f, (tg_real)0.01, NULL, &u, q, y, r, &step));
    REFUSED(tg_filter_step(&f, -1, &u, &u, q, y, r, &step));
    REFUSED(tg_filter_predict(&f, -1, &u, q));
    REFUSED(tg_filter_predict(&f, (tg_real)0.01, NULL, q));
    REFUSED(tg_filter_restart(&f, -1, y, r));
    REFUSED(tg_filter_restart(&f, 0, NULL, r));
    REFUSED(tg_consider_init(&c, &f, TG_MAX_CONSIDERED + 1));
    REFUSED(tg_consider_step(&c, NULL, NULL));
    REFUSED(tg_track_init(&track, NULL));
    other = t;
    other.policy = 9;
    REFUSED(tg_filter_init(&f, &m, &other, x, P));
    for (size_t k = 0; k < sizeof bad / sizeof *bad; k++) {
        const tg_real wrong = bad[k];
#define WITH(place, call)           \
    do {                            \
        const tg_real kept = place; \
        place = wrong;              \
        REFUSED(call);              \
        place = kept;               \
    } while (0)
        WITH(x[states - 1], tg_filter_init(&f, &m, &t, x, P));
        WITH(P[0], tg_filter_init(&f, &m, &t, x, P));
        REFUSED(tg_filter_step(&f, wrong, &u, &u, q, y, r, &step));
        REFUSED(tg_filter_restart(&f, wrong, y, r));
        WITH(r[0], tg_filter_restart(&f, 0, y, r));
        WITH(y[n], tg_filter_restart(&f, 0, y, r));
        WITH(u.load[n - 1], tg_filter_step(&f, (tg_real)0.01, &u, &u, q, y, r, &step));
        WITH(u.torque[0], tg_filter_predict(&f, (tg_real)0.01, &u, q));
        WITH(q[states - 1], tg_filter_step(&f, (tg_real)0.01, &u, &u, q, y, r, &step));
        WITH(r[n], tg_filter_step(&f, (tg_real)0.01, &u, &u, q, y, r, &step));
        if (k > 0) WITH(y[0], tg_filter_step(&f, (tg_real)0.01, &u, &u, q, y, r, &step));
        WITH(deviations.wheel_acceleration[n - 1][1], tg_consider_step(&c, &f, &deviations));
        WITH(deviations.accelerometer[0], tg_consider_step(&c, &f, &deviations));
#undef WITH
    }
    r[0] = 0;
    REFUSED(tg_filter_step(&f, (tg_real)0.01, &u, &u, q, y, r, &step));
    r[0] = (tg_real)0.01;
    now = u;
    now.load[0] = huge; /* finite, but the step is not */
    y[n + 1] = huge;
    REFUSED(tg_filter_step(&f, (tg_real)1, &now, &now, q, y, r, &step));
    memset(U, GUARD, sizeof U);
    memset(D, GUARD, sizeof D);
    REFUSED(tg_filter_factors(&f, policy == TG_BANK ? TG_MODES : 1, U, D));
    REFUSED(tg_filter_sensitivity(&f, states, D, U));
    REFUSED(tg_filter_moments(NULL, D, U));
    REFUSED(tg_consider_columns(NULL, U));
    REFUSED(tg_record_take(NULL, &track, &f, &c));
    REFUSED(tg_record_moments(0, 0, P, D, U, NULL));
    REFUSED(tg_smooth_step(n, 15, P, P, D, U, NULL));
    CHECK(untouched(U, sizeof U) && untouched(D, sizeof D), "an output was written");
}

static void curve(void)
{
    tg_curve a = tg_curve_unknown(), before = a;
    tg_pair pair = {(tg_real)0.3, (tg_real)0.2, (tg_real)0.01, (tg_real)0.001, 0, (tg_real)0.01};
    const tg_real wrong[] = {0, -1, (tg_real)NAN, (tg_real)INFINITY}, one = 1;
    for (size_t k = 0; k < sizeof wrong / sizeof *wrong; k++)
        CHECK(tg_curve_update(&a, 1, 1, 1, &pair, &wrong[k]) != TG_OK && memcmp(&a, &before, sizeof a) == 0, "share %d", (int)k);
    CHECK(tg_curve_update(&a, -1, 1, 1, &pair, &one) != TG_OK && tg_curve_update(&a, (tg_real)NAN, 1, 1, &pair, &one) != TG_OK &&
              tg_curve_update(&a, 1, 1, 9, &pair, &one) != TG_OK && tg_curve_update(&a, 1, (tg_real)INFINITY, 1, &pair, &one) != TG_OK,
          "taken");
    pair.adhesion = (tg_real)INFINITY;
    CHECK(tg_curve_update(&a, 1, 1, 1, &pair, &one) != TG_OK && memcmp(&a, &before, sizeof a) == 0, "infinite");
    CHECK(isnan((double)tg_curve_std(NULL)), "of nothing");
}

static tg_settings settings_of(int n, int method, int policy)
{
    tg_settings s = tg_default_settings();
    s.machine = random_machine(n);
    s.method = method;
    s.tuning.policy = policy;
    for (int i = 0; i < n; i++) {
        s.driven[i] = 1;
        s.wheel_share[i] = 1 / (tg_real)n;
        s.rolling_radius[i] = s.machine.radius[i];
    }
    for (int k = 0; k < TG_SLOTS; k++) s.noise[k] = (tg_real)0.05;
    CHECK(tg_tune_walks(&s) == TG_OK, "walks");
    return s;
}

/* Places of this machine alone hold numbers; of what belongs to wheels, axles or states that it has not, and of what no method gives,
 * NaN. */
static void absent_are_nan(const tg_real *o, int n, const char *what)
{
    static const int by_wheel[] = {TG_OUT_WHEEL_SPEED, TG_OUT_WHEEL_SPEED_STD, TG_OUT_ADHESION, TG_OUT_ADHESION_STD, TG_OUT_SLIP, TG_OUT_SLIP_STD,
                                   TG_OUT_NET_TRACTION, TG_OUT_NET_TRACTION_STD, TG_OUT_EFFICIENCY, TG_OUT_EFFICIENCY_STD, TG_OUT_WHEEL_CURVE,
                                   TG_OUT_WHEEL_CURVE_STD, TG_OUT_ZERO_SLIP_RADIUS, TG_OUT_ZERO_SLIP_RADIUS_STD};
    for (size_t k = 0; k < sizeof by_wheel / sizeof *by_wheel; k++)
        for (int i = n; i < TG_MAX_WHEELS; i++) CHECK(isnan((double)o[by_wheel[k] + i]), "%s, %d wheels: place %d", what, n, by_wheel[k] + i);
    for (int k = 1; k < TG_MAX_WHEELS; k++) CHECK(isnan((double)o[TG_OUT_VERTICAL_LOAD + k]), "%s: axle %d", what, k);
    for (int e = 2 * n + 2; e < NX; e++) CHECK(isnan((double)o[TG_OUT_ADAPTATION + e]), "%s: state %d", what, e);
    CHECK(isfinite((double)o[TG_OUT_GROUND_SPEED]) && isfinite((double)o[TG_OUT_WHEEL_SPEED + n - 1]), "%s: no value", what);
}

static void estimator_floor(int n, int method, int policy)
{
    const size_t size = tg_estimator_size(policy);
    tg_settings s = settings_of(n, method, policy), broken = s;
    tg_estimator *const e = malloc(size), *const before = malloc(size);
    tg_sample sample;
    tg_estimate out;
    CHECK(e && before && size > 0 && size <= (policy == TG_FIXED ? TG_ESTIMATOR_ROOM_FIXED : TG_ESTIMATOR_ROOM), "room");
    CHECK(tg_estimator_init(e, &s) == TG_OK, "init");
    uint8_t *const bytes = malloc(tg_snapshot_size(e));
    for (int k = 0; k < TG_SLOTS; k++) sample.value[k] = (tg_real)NAN;
    for (int row = 0; row < 50; row++) {
        for (int i = 0; i < n; i++) {
            sample.value[TG_WHEEL_SPEED + i] = (tg_real)(0.8 / (double)s.machine.radius[i] + 0.05 * normal());
            sample.value[TG_DRIVE_TORQUE + i] = (tg_real)(20 + normal());
        }
        sample.value[TG_GROUND_SPEED] = (tg_real)(0.7 + 0.02 * normal());
        sample.time = 0.01 * row;
        memset(&out, GUARD, sizeof out);
        CHECK(tg_estimator_update(e, &sample, &out) == TG_OK, "row %d", row);
        absent_are_nan(out.value, n, "update");
    }
    memcpy(before, e, size);
    memset(&out, GUARD, sizeof out);
    const tg_sample good = sample;
#define ESTIMATOR_REFUSED(call) CHECK((call) != TG_OK && memcmp(e, before, size) == 0 && untouched(&out, sizeof out), "refused, yet changed: " #call)
    ESTIMATOR_REFUSED(tg_estimator_update(e, &sample, &out)); /* the same time again */
    sample.time = NAN;
    ESTIMATOR_REFUSED(tg_estimator_update(e, &sample, &out));
    sample = good;
    sample.time = 1;
    sample.value[TG_WHEEL_SPEED] = (tg_real)INFINITY;
    ESTIMATOR_REFUSED(tg_estimator_update(e, &sample, &out));
    ESTIMATOR_REFUSED(tg_estimator_update(e, NULL, &out));
    broken.machine.mass = (tg_real)NAN;
    ESTIMATOR_REFUSED(tg_estimator_init(e, &broken));
    broken = s;
    broken.gap = 0;
    ESTIMATOR_REFUSED(tg_estimator_init(e, &broken));
    CHECK(bytes && tg_estimator_snapshot(e, bytes) == TG_OK, "snapshot");
    bytes[200] ^= 1;
    ESTIMATOR_REFUSED(tg_estimator_restore(e, size, bytes, tg_snapshot_size(e)));
    ESTIMATOR_REFUSED(tg_estimator_restore(e, size, bytes, 7));
    tg_real negative[TG_SLOTS] = {-1}, none[TG_SLOTS] = {0};
    ESTIMATOR_REFUSED(tg_estimator_set_noise(e, negative, none)); /* also no SD of the ground speed */
    ESTIMATOR_REFUSED(tg_estimator_set_noise(e, s.noise, negative));
    ESTIMATOR_REFUSED(tg_estimator_set_noise(e, NULL, none));
    broken.machine.wheels = 9;
    const tg_settings kept = broken;
    CHECK(tg_tune_walks(&broken) != TG_OK && memcmp(&broken, &kept, sizeof kept) == 0, "walks");

    if (method != TG_ALGEBRAIC) { /* smoothing writes no place of an absent wheel either */
        const double time = 1, value = 0.7;
        const double *in[TG_SLOTS] = {NULL};
        double slot[TG_OUT_SLOTS], *column[TG_OUT_SLOTS];
        tg_real *const record = malloc(tg_smooth_length(e) * sizeof *record), *const carry = malloc(tg_smooth_carry(e) * sizeof *carry);
        in[TG_GROUND_SPEED] = &value;
        for (int k = 0; k < TG_OUT_SLOTS; k++) {
            slot[k] = NAN;
            column[k] = &slot[k];
        }
        CHECK(record && carry && tg_estimator_record(e, 1, &time, in, record) == TG_OK, "record");
        CHECK(tg_estimator_smooth(e, 1, record, NULL, carry, column) == TG_OK, "smooth");
        tg_real o[TG_OUT_SLOTS];
        for (int k = 0; k < TG_OUT_SLOTS; k++) o[k] = (tg_real)slot[k];
        absent_are_nan(o, n, "smooth");
        free(record);
        free(carry);
    }
    free(e);
    free(before);
    free(bytes);
}

int main(void)
{
    static const int filters[][2] = {{TG_EXACT, TG_FIXED}, {TG_EXACT, TG_BANK}, {TG_EXACT, TG_ADAPTIVE}, {TG_UNSCENTED, TG_FIXED}, {TG_UNSCENTED, TG_SUPERVISED}};
    static const int estimators[][2] = {{TG_FILTERED, TG_BANK}, {TG_FILTERED, TG_FIXED}, {TG_FILTERED, TG_SUPERVISED}, {TG_ALGEBRAIC, TG_FIXED}, {TG_SPEEDS, TG_FIXED}};
    for (int n = 1; n <= TG_MAX_WHEELS; n++)
        for (size_t k = 0; k < sizeof filters / sizeof *filters; k++) {
            filter_floor(n, filters[k][0], filters[k][1]);
            estimator_floor(n, estimators[k][0], estimators[k][1]);
        }
    curve();
    printf("promises: %d refused calls changed nothing; places of absent wheels are empty for 1 to 8 wheels\n", refused);
    return 0;
}
