/* An estimator as bytes: a header that tells what the bytes are, the object but for its pointer, a checksum. A checksum is no signature: what
 * is restored may be anything, so its settings are checked as new ones are, and every count and index against its range. */
#include "estimator.h"
#include <limits.h>

#define TG_OBJECT_SIZE offsetof(tg_estimator, track)

#define TG_SNAPSHOT_VERSION 8u

typedef struct {
    char magic[8];
    uint32_t version;
    uint32_t byte_order; /* 1 as this machine writes it */
    uint32_t real_size;
    uint32_t object_size;
} tg_snapshot_header;

static tg_snapshot_header header_of_this_kernel(void)
{
    tg_snapshot_header h = {"TERRAGR", TG_SNAPSHOT_VERSION, 1u, (uint32_t)sizeof(tg_real), (uint32_t)TG_OBJECT_SIZE};
    return h;
}

/* FNV-1a, 64 bits. */
static uint64_t checksum(const uint8_t *bytes, size_t size)
{
    uint64_t hash = 14695981039346656037u;
    for (size_t k = 0; k < size; k++) hash = (hash ^ bytes[k]) * 1099511628211u;
    return hash;
}

size_t tg_estimator_size(void)
{
    return sizeof(tg_estimator);
}

size_t tg_snapshot_size(void)
{
    return sizeof(tg_snapshot_header) + TG_OBJECT_SIZE + sizeof(uint64_t);
}

tg_status tg_estimator_snapshot(const tg_estimator *e, uint8_t *bytes)
{
    if (!e || !bytes) return TG_BAD_ARGUMENT;
    tg_snapshot_header header = header_of_this_kernel();
    size_t size = sizeof header + TG_OBJECT_SIZE;
    memcpy(bytes, &header, sizeof header);
    memcpy(bytes + sizeof header, e, TG_OBJECT_SIZE);
    uint64_t hash = checksum(bytes, size);
    memcpy(bytes + size, &hash, sizeof hash);
    return TG_OK;
}

static int is_within(int32_t x, int32_t low, int32_t high)
{
    return x >= low && x <= high;
}

/* What the filter counts and indexes by. Its machine and tuning are those of the settings. */
static int filter_is_sound(const tg_filter *f, const tg_filter *fresh)
{
    if (f->wheels != fresh->wheels || f->states != fresh->states || f->channels != fresh->channels || f->stride != fresh->stride) return 0;
    if (memcmp(&f->machine, &fresh->machine, sizeof f->machine) != 0 || memcmp(&f->tuning, &fresh->tuning, sizeof f->tuning) != 0) return 0;
    /* what follows from them alone; `stiffness` decides how many substeps a step takes */
    if (memcmp(f->drag, fresh->drag, sizeof f->drag) != 0 || memcmp(f->arm, fresh->arm, sizeof f->arm) != 0 ||
        memcmp(f->inverse_inertia, fresh->inverse_inertia, sizeof f->inverse_inertia) != 0 || f->inverse_mass != fresh->inverse_mass ||
        f->stiffness != fresh->stiffness || memcmp(f->walk, fresh->walk, sizeof f->walk) != 0)
        return 0;
    if (!is_within(f->taken, 0, f->channels) || !is_within(f->formed, 0, 1) || !is_within(f->factor_steps, 0, 1000)) return 0;
    for (int32_t c = 0; c < f->taken; c++)
        if (!is_within(f->channel[c], 0, f->channels - 1)) return 0;
    if (!is_within(f->supervisor.count, 0, TG_SNAPSHOTS) || !is_within(f->supervisor.first, 0, TG_SNAPSHOTS - 1)) return 0;
    return is_within(f->tuning.policy == TG_BANK ? f->policy.bank.updates : f->policy.adaptation.updates, 0, INT_MAX / 2);
}

static int is_sound(const tg_estimator *e, const tg_estimator *fresh)
{
    if (!filter_is_sound(&e->filter, &fresh->filter)) return 0;
    if (e->consider.columns != fresh->consider.columns || e->consider.wheels != fresh->consider.wheels ||
        e->consider.states != fresh->consider.states || e->belief.columns != fresh->belief.columns)
        return 0;
    if ((e->direction != 1 && e->direction != -1) || !is_within(e->started, 0, 1) || !is_within(e->seen_motion, 0, 1) ||
        !is_within(e->standing, 0, 1))
        return 0;
    return memcmp(&e->constants, &fresh->constants, sizeof e->constants) == 0;
}

tg_status tg_estimator_restore(tg_estimator *e, const uint8_t *bytes, size_t size)
{
    if (!e || !bytes) return TG_BAD_ARGUMENT;
    tg_snapshot_header header = header_of_this_kernel();
    uint64_t hash;
    if (size != tg_snapshot_size() || memcmp(bytes, &header, sizeof header) != 0) return TG_BAD_SNAPSHOT;
    memcpy(&hash, bytes + size - sizeof hash, sizeof hash);
    if (hash != checksum(bytes, size - sizeof hash)) return TG_BAD_SNAPSHOT;
    tg_estimator found, fresh;
    memset(&found, 0, sizeof found);
    memcpy(&found, bytes + sizeof header, TG_OBJECT_SIZE);
    if (tg_estimator_init(&fresh, &found.settings) != TG_OK || !is_sound(&found, &fresh)) return TG_BAD_SNAPSHOT;
    memcpy(e, &found, sizeof *e);
    return TG_OK;
}
