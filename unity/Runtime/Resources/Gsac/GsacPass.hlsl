// Vertex and Fragment of every pipeline's pass. The pass has included its pipeline's file, which brings UNITY_MATRIX_V,
// UNITY_MATRIX_P and the stereo macros, and says GSAC_SCREEN (px), GSAC_ORIGIN (place of the pipeline's origin) and, where the
// pipeline has fog by distance, GSAC_FOGGED (a colour at a clip-space z).
#include "GsacDraw.hlsl"

float4 GsacTint; // factor of the colours, how much of the person is there
uint GsacFog;    // 1: the scene's fog lies over the person
uint GsacNumber; // of this draw
StructuredBuffer<uint> GsacLatest; // 1: the draw that counts

struct GsacInput
{
    uint vertex : SV_VertexID;
    UNITY_VERTEX_INPUT_INSTANCE_ID
};

struct GsacVaryings
{
    float4 clip : SV_Position;
    float2 sigmas : TEXCOORD0;
    nointerpolation float4 colour : TEXCOORD1;
    UNITY_VERTEX_OUTPUT_STEREO
};

GsacVaryings Vertex(GsacInput input)
{
    GsacVaryings output;
    UNITY_SETUP_INSTANCE_ID(input);
    UNITY_INITIALIZE_VERTEX_OUTPUT_STEREO(output);
    GsacCorner corner = GsacSplatCorner(input.vertex, UNITY_MATRIX_V, UNITY_MATRIX_P, GSAC_SCREEN, GSAC_ORIGIN);
    output.clip = GsacLatest[0] == GsacNumber ? corner.clip : float4(2, 2, 2, 1);
    output.sigmas = corner.sigmas;
    output.colour = float4(corner.colour.rgb * GsacTint.rgb, corner.colour.a);
#ifdef GSAC_FOGGED
    if (GsacFog) output.colour.rgb = GSAC_FOGGED(output.colour.rgb, corner.clip.z);
#endif
    return output;
}

// 0..1 by pixel, without a pattern that the eye follows: interleaved gradient noise (Jimenez 2014).
float GsacThreshold(float2 pixel)
{
    return frac(52.9829189 * frac(dot(floor(pixel), float2(0.06711056, 0.00583715))));
}

// A person who fades loses pixels, all layers of one at once: were the gaussians made fainter, her inside would shine through.
float4 Fragment(GsacVaryings input) : SV_Target
{
    UNITY_SETUP_STEREO_EYE_INDEX_POST_VERTEX(input);
    if (GsacTint.a < 1) clip(GsacTint.a - GsacThreshold(input.clip.xy) - 1e-4);
    return GsacPixel(input.sigmas, input.colour);
}
