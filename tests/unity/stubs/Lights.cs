// Stands for Unity's lights, probes and rays: what a test says is there. API.md: pages and versions.
using System;

namespace UnityEngine
{
    public enum LightShadows { None, Hard, Soft }

    public sealed class Light : Behaviour
    {
        public Color color { get; set; } = Color.white;
        public float intensity { get; set; } = 1;
        public LightShadows shadows { get; set; }
    }

    public static class RenderSettings
    {
        public static Light sun { get; set; }
    }

    public static class LightProbes
    {
        public static void GetInterpolatedProbe(Vector3 position, Renderer renderer, out Rendering.SphericalHarmonicsL2 probe)
        {
            probe = Player.Probe;
        }
    }

    public struct LayerMask
    {
        public int value { get; set; }
        public static implicit operator LayerMask(int intVal) { return new LayerMask { value = intVal }; }
        public static implicit operator int(LayerMask mask) { return mask.value; }
    }

    public enum QueryTriggerInteraction { Ignore = 1 }

    public class Collider : Component
    {
        public bool isTrigger { get; set; }
    }

    public sealed class CapsuleCollider : Collider
    {
        public float radius { get; set; }
        public float height { get; set; }
    }

    public struct RaycastHit
    {
        public Transform transform { get; internal set; }
    }

    public static class Physics
    {
        public const int DefaultRaycastLayers = ~4;
        public static int RaycastNonAlloc(Vector3 origin, Vector3 direction, RaycastHit[] results, float maxDistance, int layerMask, QueryTriggerInteraction queryTriggerInteraction)
        {
            int count = 0;
            foreach (Transform met in Player.BeforeSun) results[count++] = new RaycastHit { transform = met };
            return count;
        }
    }
}

namespace UnityEngine.Rendering
{
    public struct SphericalHarmonicsL2
    {
        float[] numbers;
        public float this[int rgb, int coefficient]
        {
            get { return numbers == null ? 0 : numbers[rgb * 9 + coefficient]; }
            set
            {
                if (numbers == null) numbers = new float[27];
                numbers[rgb * 9 + coefficient] = value;
            }
        }
    }
}
