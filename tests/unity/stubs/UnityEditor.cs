// Stands for Unity's editor, compiled apart: the package's Runtime must do without it. API.md: pages and versions.
using System;
using System.Collections.Generic;

namespace UnityEditor
{
    using UnityEngine;

    public enum MessageType { Error = 3 }

    public class Editor : ScriptableObject
    {
        public UnityEngine.Object target { get; set; }
        public UnityEngine.Object[] targets { get { return Player.Chosen ?? new[] { target }; } }
        public virtual void OnInspectorGUI() { }
        public virtual bool RequiresConstantRepaint() { return false; }
        public bool DrawDefaultInspector() { return false; }
    }

    public static class EditorGUI
    {
        internal static bool Changed;
        public static void BeginChangeCheck() { Changed = false; }
        public static bool EndChangeCheck() { return Changed; }
    }

    public static class EditorGUILayout
    {
        public static void Space() { }
        public static void LabelField(string label, GUIStyle style, params GUILayoutOption[] options) { }
        public static void LabelField(string label, string label2, params GUILayoutOption[] options) { Player.Labels.Add(label + " = " + label2); }
        public static Rect BeginHorizontal(params GUILayoutOption[] options) { return new Rect(); }
        public static void EndHorizontal() { }
        public static int Popup(string label, int selectedIndex, string[] displayedOptions, params GUILayoutOption[] options)
        {
            return (int)Slider(label, selectedIndex, 0, displayedOptions.Length - 1);
        }
        public static float Slider(string label, float value, float leftValue, float rightValue, params GUILayoutOption[] options)
        {
            float moved;
            if (!Player.Slides.TryGetValue(label, out moved)) return value;
            EditorGUI.Changed |= moved != value;
            return moved;
        }
        public static bool Toggle(string label, bool value, params GUILayoutOption[] options) { return value; }
        public static void HelpBox(string message, MessageType type) { Player.Labels.Add(type + ": " + message); }
        public static string DelayedTextField(string label, string text, params GUILayoutOption[] options)
        {
            if (Player.Typed == null) return text;
            EditorGUI.Changed |= Player.Typed != text;
            return Player.Typed;
        }
    }

    public static class Handles
    {
        public static Vector3 PositionHandle(Vector3 position, Quaternion rotation)
        {
            Vector3 to;
            Player.HandlesSeen++;
            if (!Player.Drags.TryGetValue(Player.HandlesSeen, out to)) return position;
            EditorGUI.Changed = true;
            return to;
        }
    }

    public static class EditorStyles
    {
        public static GUIStyle boldLabel { get { return null; } }
    }

    public static class EditorUtility
    {
        public static bool IsPersistent(UnityEngine.Object target) { return false; }
        public static bool DisplayDialog(string title, string message, string ok)
        {
            Player.Labels.Add(message);
            return true;
        }
        public static void RevealInFinder(string path) { }
    }

    public static class EditorApplication
    {
        public delegate void CallbackFunction();
        public static CallbackFunction update;
        public static void QueuePlayerLoopUpdate() { Player.UpdatesAsked++; }
    }

    public static class Undo
    {
        static readonly List<Action> Kept = new List<Action>();
        public static void RecordObject(UnityEngine.Object objectToUndo, string name) { RecordObjects(new[] { objectToUndo }, name); }
        public static void RecordObjects(UnityEngine.Object[] objectsToUndo, string name)
        {
            foreach (UnityEngine.Object one in objectsToUndo) Kept.Add(Player.Restore(one));
        }
        // all that was recorded, where Unity takes one step
        public static void PerformUndo()
        {
            for (int i = Kept.Count - 1; i >= 0; i--) Kept[i]();
            Kept.Clear();
        }
    }

    public class SceneVisibilityManager : ScriptableObject
    {
        public static SceneVisibilityManager instance { get; } = new SceneVisibilityManager();
        public readonly HashSet<GameObject> Hidden = new HashSet<GameObject>();
        public bool IsHidden(GameObject gameObject, bool includeDescendants = false) { return Hidden.Contains(gameObject); }
    }

    [AttributeUsage(AttributeTargets.Class)] public sealed class CustomEditor : Attribute { public CustomEditor(Type inspectedType) { } }
    [AttributeUsage(AttributeTargets.Class)] public sealed class CanEditMultipleObjects : Attribute { }

    public sealed class AnimationClipSettings
    {
        public bool loopTime { get; set; }
        public bool loopBlendOrientation { get; set; }
        public bool loopBlendPositionY { get; set; }
        public bool loopBlendPositionXZ { get; set; }
        public bool keepOriginalOrientation { get; set; }
        public bool keepOriginalPositionY { get; set; }
        public bool keepOriginalPositionXZ { get; set; }
    }

    public static class AnimationUtility
    {
        static readonly Dictionary<AnimationClip, AnimationClipSettings> Settings = new Dictionary<AnimationClip, AnimationClipSettings>();
        public static AnimationClipSettings GetAnimationClipSettings(AnimationClip clip)
        {
            AnimationClipSettings known;
            return Settings.TryGetValue(clip, out known) ? known : new AnimationClipSettings();
        }
        public static void SetAnimationClipSettings(AnimationClip clip, AnimationClipSettings srcClipInfo) { Settings[clip] = srcClipInfo; }
    }

    [AttributeUsage(AttributeTargets.Class)] public sealed class InitializeOnLoadAttribute : Attribute { }
}

namespace UnityEditor.SceneManagement
{
    using UnityEngine;

    public static class StageUtility
    {
        /// <summary>The test's: what a camera shows that has a stage of its own.</summary>
        public static readonly Dictionary<Camera, GameObject> Staged = new Dictionary<Camera, GameObject>();
        public static bool IsGameObjectRenderedByCamera(GameObject gameObject, Camera camera)
        {
            GameObject only;
            return !Staged.TryGetValue(camera, out only) || ReferenceEquals(only, gameObject);
        }
    }
}

namespace UnityEditor.AssetImporters
{
    using UnityEngine;

    public abstract class AssetImporter : UnityEngine.Object
    {
    }

    public abstract class ScriptedImporter : AssetImporter
    {
        public abstract void OnImportAsset(AssetImportContext ctx);
    }

    public class AssetImportContext
    {
        public readonly Dictionary<string, UnityEngine.Object> Added = new Dictionary<string, UnityEngine.Object>();
        public readonly List<string> Words = new List<string>();
        public string assetPath { get; set; }
        public UnityEngine.Object mainObject { get; private set; }
        public void AddObjectToAsset(string identifier, UnityEngine.Object obj) { Added.Add(identifier, obj); }
        public void AddObjectToAsset(string identifier, UnityEngine.Object obj, Texture2D thumbnail)
        {
            Thumbnail = thumbnail;
            Added.Add(identifier, obj);
        }
        public Texture2D Thumbnail;
        public void SetMainObject(UnityEngine.Object obj) { mainObject = obj; }
        public void LogImportError(string msg) { Words.Add("error: " + msg); }
        public void LogImportWarning(string msg) { Words.Add("warning: " + msg); }
    }

    [AttributeUsage(AttributeTargets.Class)] public sealed class ScriptedImporterAttribute : Attribute
    {
        public ScriptedImporterAttribute(int version, string ext) { }
    }
}
