// Vertex and Fragment of every pipeline's pass. The pass has included its pipeline's file, which brings UNITY_MATRIX_V,
// UNITY_MATRIX_P and the stereo macros, and says GSAC_SCREEN (px), GSAC_ORIGIN (place of the pipeline's origin) and, where the
// pipeline has fog, GSAC_FOGGED (a colour at a place in clip space).
#include "GsacDraw.hlsl"
#include "GsacFinish.hlsl"
#include "GsacLatest.hlsl"

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
    output.clip = GsacIfLatest(corner.clip);
    output.sigmas = corner.sigmas;
    output.colour = float4(GsacThroughFog(corner.colour.rgb * GsacTint.rgb, corner.clip), corner.colour.a);
    return output;
}

float4 Fragment(GsacVaryings input) : SV_Target
{
    UNITY_SETUP_STEREO_EYE_INDEX_POST_VERTEX(input);
    GsacFade(input.clip.xy);
    return GsacPixel(input.sigmas, input.colour);
}
