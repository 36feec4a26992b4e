// Learned parameters of the body beside its poses: shape (betas) and joints at rest, shared by all frames, and each frame's
// expression. Gradient by their directions, Adam, and the body moved on.

// (blocks of vertices), after the step's pose update. The last block takes the step.
extern "C" __global__ void __launch_bounds__(256) shape_gradient(Scene s) {
    __shared__ float scratch[8];
    __shared__ int last;
    if (halted(s)) return;
    State &state = *s.state;
    int tid = threadIdx.x, v = blockIdx.x * 256 + tid;
    Vec<float> rest = {0, 0, 0};
    float joint = 0;
    for (int b = 0; b < s.batch; ++b) {
        if (v < s.vertex_count) rest = rest + vec(s.grad_rest + 3 * (size_t(b) * s.vertex_count + v));
        if (blockIdx.x == 0 && tid < 165) joint += s.grad_joints[b * 165 + tid];
    }
    for (int k = 0; k < s.beta_count; ++k) {
        float sum = 0;
        if (v < s.vertex_count) sum = dot(rest, vec(s.shape + 3 * (size_t(k) * s.vertex_count + v)));
        if (blockIdx.x == 0 && tid < 165) sum += joint * s.joint_shape[k * 165 + tid];
        __syncthreads();
        sum = sum_block(sum, scratch);
        if (tid == 0) s.beta_part[blockIdx.x * s.beta_count + k] = sum;
    }
    __threadfence();
    __syncthreads();
    if (tid == 0) last = atomicAdd(&state.shape_done, 1) == int(gridDim.x) - 1;
    __syncthreads();
    if (!last) return;
    __threadfence();
    if (tid == 0) state.shape_done = 0;
    if (tid >= s.beta_count) return;
    double g = 0, n = state.step;
    for (unsigned k = 0; k < gridDim.x; ++k) g += __ldcg(s.beta_part + k * s.beta_count + tid);
    g /= s.batch;
    double first = s.beta_first[tid] += 0.1 * (g - s.beta_first[tid]);
    double second = s.beta_second[tid] += s.fresh * (g * g - s.beta_second[tid]);
    double move = -s.now[0].plan.betas * (first / (1 - pow(0.9, n))) / (sqrt(second / (1 - pow(1 - s.fresh, n))) + s.tiny);
    s.betas[tid] += move;
    s.beta_move[tid] = float(move);
}

// (blocks of vertices). The move of the betas, on the displacement of the vertices and on the joints.
extern "C" __global__ void __launch_bounds__(256) shape_step(Scene s) {
    if (halted(s)) return;
    int v = blockIdx.x * 256 + threadIdx.x;
    if (v < s.vertex_count) {
        Vec<float> move = {0, 0, 0};
        for (int k = 0; k < s.beta_count; ++k) move = move + vec(s.shape + 3 * (size_t(k) * s.vertex_count + v)) * s.beta_move[k];
        s.offset[3 * v] += move.x;
        s.offset[3 * v + 1] += move.y;
        s.offset[3 * v + 2] += move.z;
    }
    if (blockIdx.x == 0 && threadIdx.x < 165)
        for (int k = 0; k < s.beta_count; ++k) s.joints[threadIdx.x] += s.joint_shape[k * 165 + threadIdx.x] * s.beta_move[k];
}

// (expressions, batch), after the step's pose update: one coefficient of one frame.
extern "C" __global__ void __launch_bounds__(256) expression_step(Scene s) {
    __shared__ float scratch[8];
    if (halted(s)) return;
    const Now &now = s.now[blockIdx.y];
    const float *grad = s.grad_rest + 3 * size_t(blockIdx.y) * s.vertex_count;
    const float *way = s.expression_dirs + 3 * size_t(blockIdx.x) * s.vertex_count;
    float sum = 0;
    for (int v = threadIdx.x; v < s.vertex_count; v += 256) sum += dot(vec(grad + 3 * v), vec(way + 3 * v));
    sum = sum_block(sum, scratch);
    if (threadIdx.x > 0) return;
    size_t at = size_t(now.frame.pose) * s.expression_count + blockIdx.x;
    adam_pulled(s.expression[at], double(sum) / s.batch, s.expression_first[at], s.expression_second[at], s.pose_steps[now.frame.pose],
                double(now.plan.expression), double(s.pose_pull), 1.0, s.fresh, s.tiny);
}

// One block, after the step's pose update: the joints at rest.
extern "C" __global__ void __launch_bounds__(192) place_joints(Scene s) {
    if (halted(s)) return;
    int i = threadIdx.x;
    if (i >= 165) return;
    double sum = 0;
    for (int b = 0; b < s.batch; ++b) sum += s.grad_joints[b * 165 + i];
    double before = s.joint_offset[i], value = before;
    adam_pulled(value, sum / s.batch, s.joint_first[i], s.joint_second[i], s.state->step,
                s.joint_share[i / 3] * s.now[0].plan.joints, double(s.pose_pull), double(s.joint_unit));
    s.joint_offset[i] = value;
    s.joints[i] += float(value - before);
}
