/* An estimator as bytes: a header that tells what the bytes are, the object itself, a checksum. */
#include "estimator.h"

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
    tg_snapshot_header h = {"TERRAGR", TG_SNAPSHOT_VERSION, 1u, (uint32_t)sizeof(tg_real), (uint32_t)sizeof(tg_estimator)};
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
    return sizeof(tg_snapshot_header) + sizeof(tg_estimator) + sizeof(uint64_t);
}

tg_status tg_estimator_snapshot(const tg_estimator *e, uint8_t *bytes)
{
    if (!e || !bytes) return TG_BAD_ARGUMENT;
    tg_snapshot_header header = header_of_this_kernel();
    size_t size = sizeof header + sizeof *e;
    memcpy(bytes, &header, sizeof header);
    memcpy(bytes + sizeof header, e, sizeof *e);
    uint64_t hash = checksum(bytes, size);
    memcpy(bytes + size, &hash, sizeof hash);
    return TG_OK;
}

tg_status tg_estimator_restore(tg_estimator *e, const uint8_t *bytes, size_t size)
{
    if (!e || !bytes) return TG_BAD_ARGUMENT;
    tg_snapshot_header header = header_of_this_kernel();
    uint64_t hash;
    if (size != tg_snapshot_size() || memcmp(bytes, &header, sizeof header) != 0) return TG_BAD_SNAPSHOT;
    memcpy(&hash, bytes + size - sizeof hash, sizeof hash);
    if (hash != checksum(bytes, size - sizeof hash)) return TG_BAD_SNAPSHOT;
    memcpy(e, bytes + sizeof header, sizeof *e);
    return TG_OK;
}
