// Sorting and compositing of tiles, and the gradient of the compositing.
// A warp owns 8x4 pixels of the 16x16 tile and looks only at gaussians whose box reaches them.

constexpr int SORTED = 2048, WARPS = 8;

// Splats of up to SEGMENT entries of a list, staged for the block.
struct Staged {
    float4 a[SEGMENT], b[SEGMENT], c[SEGMENT];
};

FORMULA void stage(const Scene &s, Staged &staged, int batch, int j, unsigned gaussian) {
    const float4 *splat = (const float4 *)s.splat + 3 * (size_t(batch) * s.count + gaussian);
    staged.a[j] = splat[0];
    staged.b[j] = splat[1];
    staged.c[j] = splat[2];
}

// Pixel of this thread in its tile.
FORMULA int2 own_pixel() {
    int warp = threadIdx.x / 32, lane = threadIdx.x % 32;
    return {warp % 2 * 8 + lane % 8, warp / 2 * 4 + lane / 8};
}

// Which of the 32 staged entries from `base` on reach the warp's pixel centres, (x - 3.5 .. x + 3.5) by (y - 1.5 .. y + 1.5):
// the least exponent over that box lies at its point nearest to the centre, or on an edge that faces the centre.
FORMULA unsigned reaching(const Staged &staged, int base, int n, float x, float y) {
    int j = base + threadIdx.x % 32;
    bool hit = false;
    if (j < n) {
        float4 a = staged.a[j], b = staged.b[j];
        float x0 = x - 3.5f - a.x, x1 = x0 + 7, y0 = y - 1.5f - a.y, y1 = y0 + 3;
        float dx = fminf(fmaxf(0, x0), x1), dy = fminf(fmaxf(0, y0), y1);
        if (fabsf(dx) <= b.w && fabsf(dy) <= staged.c[j].w) {
            float ey = fminf(fmaxf(-a.w * dx / (2 * b.x), y0), y1), ex = fminf(fmaxf(-a.w * dy / (2 * a.z), x0), x1);
            float least = fminf(dx * (dx * a.z + ey * a.w) + ey * ey * b.x, ex * (ex * a.z + dy * a.w) + dy * dy * b.x);
            hit = least <= b.y * 1.0001f + 1e-4f;
        }
    }
    return __ballot_sync(~0u, hit);
}

FORMULA float alpha_at(const Staged &staged, int j, float x, float y) {
    float4 p = staged.a[j], q = staged.b[j];
    float dx = x - p.x, dy = y - p.y;
    bool clipped;
    return alpha_of(dx * (dx * p.z + dy * p.w) + dy * dy * q.x, q.y, q.z, clipped);
}

// Sorts n keys ascending with the whole block; strides inside a warp's own 64 keys need no block barrier.
FORMULA void sort(unsigned long long *keys, int n) {
    int room = 2;
    while (room < n) room *= 2;
    for (int size = 2; size <= room; size *= 2)
        for (int stride = size / 2; stride > 0; stride /= 2) {
            for (int p = threadIdx.x; p < room / 2; p += PIXELS) {
                int low = (p & ~(stride - 1)) * 2 + (p & (stride - 1));
                int high = stride == size / 2 ? low + size - 1 - 2 * (p & (stride - 1)) : low + stride;
                if (high < n) {
                    unsigned long long x = keys[low], y = keys[high];
                    if (y < x) {
                        keys[low] = y;
                        keys[high] = x;
                    }
                }
            }
            bool warp_only = stride <= 32 && (stride > 1 || size <= 32);
            if (warp_only) __syncwarp();
            else __syncthreads();
        }
    __syncthreads();
}

// (blocks). Each takes tiles until none is left, those with long lists first.
extern "C" __global__ void __launch_bounds__(PIXELS) blend(Scene s) {
    __shared__ unsigned long long keys[SORTED];
    __shared__ Staged staged;
    __shared__ int turn;
    if (halted(s)) return;
    State &state = *s.state;
    int heavy = state.heavy, total = heavy + state.light;
    while (true) {
        __syncthreads();
        if (threadIdx.x == 0) turn = atomicAdd(&state.blend_ticket, 1);
        __syncthreads();
        if (turn >= total) return;
        int tile = turn < heavy ? s.heavy[turn] : s.light[turn - heavy];
        int b = tile / s.max_tiles, t = tile % s.max_tiles, n = s.tile_count[tile];
        const Now &now = s.now[b];
        unsigned long long *list = s.list + s.tile_start[tile], *sorted = n <= SORTED ? keys : list;
        if (n <= SORTED)
            for (int i = threadIdx.x; i < n; i += PIXELS) keys[i] = list[i];
        __syncthreads();
        sort(sorted, n);
        if (n <= SORTED)
            for (int i = threadIdx.x; i < n; i += PIXELS) list[i] = keys[i];

        int2 own = own_pixel();
        int left = t % now.columns * TILE, top = t / now.columns * TILE, x = left + own.x, y = top + own.y;
        bool inside = x < now.frame.width && y < now.frame.height;
        int warp = threadIdx.x / 32;
        float px = x + 0.5f, py = y + 0.5f, middle_x = left + warp % 2 * 8 + 4.0f, middle_y = top + warp / 2 * 4 + 2.0f;
        float T = inside ? 1 : 0, red = 0, green = 0, blue = 0, alpha = 0;
        int done = n;
        for (int begin = 0; begin < n; begin += SEGMENT) {
            bool over = __syncthreads_and(T == 0);
            if (begin > 0) {
                float4 *check = (float4 *)s.checkpoint + size_t(s.tile_check[tile] + begin / SEGMENT - 1) * PIXELS;
                check[threadIdx.x] = {red, green, blue, T};
            }
            if (over) {
                done = begin;
                break;
            }
            int here = min(SEGMENT, n - begin);
            if (threadIdx.x < here) stage(s, staged, b, threadIdx.x, unsigned(sorted[begin + threadIdx.x]));
            __syncthreads();
            for (int base = 0; base < here; base += 32) {
                unsigned hits = reaching(staged, base, here, middle_x, middle_y);
                while (hits) {
                    // two at a time: their alphas do not wait for each other
                    int j = base + __ffs(hits) - 1;
                    hits &= hits - 1;
                    bool both = hits != 0;
                    int k = both ? base + __ffs(hits) - 1 : j;
                    hits &= hits - 1;
                    float first = alpha_at(staged, j, px, py), second = both ? alpha_at(staged, k, px, py) : 0;
                    float4 c = staged.c[j], e = staged.c[k];
                    float weight = composite(first, T), other = composite(second, T);
                    red += weight * c.x + other * e.x;
                    green += weight * c.y + other * e.y;
                    blue += weight * c.z + other * e.z;
                    alpha += weight + other;
                }
                if (__all_sync(~0u, T == 0)) break;
            }
        }
        if (threadIdx.x == 0) s.tile_done[tile] = done;
        if (inside) ((float4 *)s.image)[b * size_t(s.max_pixels) + y * now.frame.width + x] = {red, green, blue, alpha};
    }
}

// Sums eight numbers over the warp; lane l holds the sum of number l / 4 afterwards.
FORMULA float sum_eight(const float *v) {
    int lane = threadIdx.x % 32;
    float four[4], two[2], one;
    bool high = lane & 16;
    for (int i = 0; i < 4; ++i) four[i] = (high ? v[i + 4] : v[i]) + __shfl_xor_sync(~0u, high ? v[i] : v[i + 4], 16);
    high = lane & 8;
    for (int i = 0; i < 2; ++i) two[i] = (high ? four[i + 2] : four[i]) + __shfl_xor_sync(~0u, high ? four[i] : four[i + 2], 8);
    high = lane & 4;
    one = (high ? two[1] : two[0]) + __shfl_xor_sync(~0u, high ? two[0] : two[1], 4);
    one += __shfl_xor_sync(~0u, one, 2);
    return one + __shfl_xor_sync(~0u, one, 1);
}

FORMULA float sum_warp(float v) {
    for (int step = 16; step > 0; step /= 2) v += __shfl_xor_sync(~0u, v, step);
    return v;
}

// (blocks). Each takes segments of lists until none is left; nine moments for every (tile, gaussian), no float atomics.
extern "C" __global__ void __launch_bounds__(PIXELS) blend_backward(Scene s) {
    __shared__ Staged staged;
    __shared__ float part[WARPS][SEGMENT][9];
    __shared__ unsigned written[WARPS][SEGMENT / 32];
    __shared__ int slot[SEGMENT];
    __shared__ int turn;
    if (halted(s)) return;
    State &state = *s.state;
    int total = state.segments, warp = threadIdx.x / 32, lane = threadIdx.x % 32;
    while (true) {
        __syncthreads();
        if (threadIdx.x == 0) turn = atomicAdd(&state.back_ticket, 1);
        __syncthreads();
        if (turn >= total) return;
        int2 work = ((int2 *)s.segment)[turn];
        int tile = work.x, b = tile / s.max_tiles, t = tile % s.max_tiles, begin = work.y * SEGMENT;
        const Now &now = s.now[b];
        int here = min(SEGMENT, s.tile_count[tile] - begin), columns = now.columns;
        bool skipped = begin >= s.tile_done[tile];
        if (threadIdx.x < here) {
            unsigned gaussian = unsigned(s.list[s.tile_start[tile] + begin + threadIdx.x]);
            int at = b * s.count + gaussian;
            ushort4 box = ((ushort4 *)s.box)[at];
            slot[threadIdx.x] = s.slot_start[at] + (t / columns - box.z) * (box.y - box.x) + t % columns - box.x;
            stage(s, staged, b, threadIdx.x, gaussian);
        }
        if (lane < SEGMENT / 32) written[warp][lane] = 0;
        __syncthreads();

        int2 own = own_pixel();
        int left = t % columns * TILE, top = t / columns * TILE, x = left + own.x, y = top + own.y;
        if (!skipped) {
            float px = x + 0.5f, py = y + 0.5f, middle_x = left + warp % 2 * 8 + 4.0f, middle_y = top + warp / 2 * 4 + 2.0f;
            float T = 0, behind = 0;
            float4 v = {0, 0, 0, 0};
            if (x < now.frame.width && y < now.frame.height) {
                size_t pixel = b * size_t(s.max_pixels) + y * now.frame.width + x;
                float4 image = ((float4 *)s.image)[pixel], before = {0, 0, 0, 1};
                v = ((float4 *)s.grad_image)[pixel];
                if (begin > 0) before = ((float4 *)s.checkpoint)[size_t(s.tile_check[tile] + work.y - 1) * PIXELS + threadIdx.x];
                T = before.w;
                behind = v.x * (image.x - before.x) + v.y * (image.y - before.y) + v.z * (image.z - before.z)
                         + v.w * (image.w - (1 - T));
            }
            for (int base = 0; base < here; base += 32) {
                if (__all_sync(~0u, T == 0)) break;
                unsigned hits = reaching(staged, base, here, middle_x, middle_y), wrote = 0;
                while (hits) {
                    int bit = __ffs(hits) - 1, j = base + bit;
                    hits &= hits - 1;
                    float4 p = staged.a[j], q = staged.b[j], c = staged.c[j];
                    float dx = px - p.x, dy = py - p.y;
                    bool clipped;
                    float a = alpha_of(dx * (dx * p.z + dy * p.w) + dy * dy * q.x, q.y, q.z, clipped), weight = composite(a, T);
                    if (!__any_sync(~0u, weight > 0)) continue;
                    float g = composite_backward(weight, a, clipped, v.x * c.x + v.y * c.y + v.z * c.z + v.w, behind);
                    float eight[8] = {g, g * dx, g * dy, g * dx * dx, g * dx * dy, g * dy * dy, weight * v.x, weight * v.y};
                    float mine = sum_eight(eight), last = sum_warp(weight * v.z);
                    if (lane % 4 == 0) part[warp][j][lane / 4] = mine;
                    if (lane == 1) part[warp][j][8] = last;
                    wrote |= 1u << bit;
                }
                if (lane == 0) written[warp][base / 32] = wrote;
            }
        }
        __syncthreads();
        for (int e = threadIdx.x; e < here * 9; e += PIXELS) {
            int j = e / 9, m = e % 9;
            float sum = 0;
            for (int w = 0; w < WARPS; ++w)
                if (written[w][j / 32] >> j % 32 & 1) sum += part[w][j][m];
            s.moments[size_t(slot[j]) * 9 + m] = sum;
        }
    }
}
