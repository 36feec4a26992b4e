// Stands for Unity's textures and gizmos: pixels are kept, balls are remembered. API.md: pages and versions.
using System.Collections.Generic;

namespace UnityEngine
{
    public struct Color32
    {
        public byte r, g, b, a;
        public Color32(byte r, byte g, byte b, byte a) { this.r = r; this.g = g; this.b = b; this.a = a; }
    }

    public class Texture : Object
    {
    }

    public sealed class Texture2D : Texture
    {
        public int width { get; private set; }
        public int height { get; private set; }
        Color32[] pixels;
        public Texture2D(int width, int height)
        {
            this.width = width;
            this.height = height;
            pixels = new Color32[width * height];
        }
        public void SetPixels32(Color32[] colors) { pixels = (Color32[])colors.Clone(); }
        public Color32[] GetPixels32() { return (Color32[])pixels.Clone(); }
        public void Apply() { }
        public void ReadPixels(Rect source, int destX, int destY) { pixels = (Color32[])RenderTexture.active.Pixels.Clone(); }
    }

    public static class Gizmos
    {
        /// <summary>Not Unity's: centre and radius of each ball.</summary>
        public static readonly List<KeyValuePair<Vector3, float>> Balls = new List<KeyValuePair<Vector3, float>>();
        public static Color color { get; set; }
        public static void DrawSphere(Vector3 center, float radius) { Balls.Add(new KeyValuePair<Vector3, float>(center, radius)); }
    }
}
