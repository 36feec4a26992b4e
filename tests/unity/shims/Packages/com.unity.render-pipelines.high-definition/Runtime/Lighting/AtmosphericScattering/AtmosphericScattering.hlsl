// Stands for HDRP's file of this name in the tests: fog by distance alone, its colour times its opacity.
float4 TestFog; // colour, density per metre
void EvaluateAtmosphericScattering(PositionInputs place, float3 towardsEye, out float3 colour, out float3 opacity)
{
    float away = TestFog.w * length(place.positionWS);
    opacity = 1 - exp2(-away * away);
    colour = opacity * TestFog.rgb;
}
