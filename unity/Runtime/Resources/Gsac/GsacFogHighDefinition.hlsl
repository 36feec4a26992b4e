// HDRP's fog, volumetric where that is on, for GsacFinish.hlsl; after ShaderVariables.hlsl.
#include "Packages/com.unity.render-pipelines.core/ShaderLibrary/Color.hlsl"
#include "Packages/com.unity.render-pipelines.high-definition/Runtime/Lighting/AtmosphericScattering/AtmosphericScattering.hlsl"

float3 GsacFogged(float3 colour, float4 clip)
{
    float3 place = clip.xyz / clip.w;
    PositionInputs at;
    ZERO_INITIALIZE(PositionInputs, at);
    at.positionNDC = place.xy * 0.5 + 0.5;
#if UNITY_UV_STARTS_AT_TOP
    at.positionNDC.y = 1 - at.positionNDC.y;
#endif
    at.deviceDepth = place.z;
    at.positionWS = ComputeWorldSpacePosition(at.positionNDC, place.z, UNITY_MATRIX_I_VP);
    at.linearDepth = LinearEyeDepth(at.positionWS, UNITY_MATRIX_V);
    float3 fog;
    float3 opacity;
    EvaluateAtmosphericScattering(at, GetWorldSpaceNormalizeViewDir(at.positionWS), fog, opacity);
    return colour * (1 - opacity) + fog;
}
#define GSAC_FOGGED(colour, clip) GsacFogged(colour, clip)
